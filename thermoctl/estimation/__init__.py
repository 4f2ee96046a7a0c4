"""What is believed about the plant, and how sure the belief is.

Parameters of an ARX model: `recursion` is the update that all laws share; `least_squares` and
`kalman` are the laws, `guards` a wrapper that keeps any of them sane for years, and `identifier`
forms the regressor and asks a law. `belief` begins and checks, `stack` holds theta and P in one
array; `batch` and `batch_one` run many replications at once.

States of a known model: `state_space`, and `fading` with its fading factors.

Order and delay: `bank`, the Lainiotis filter.
"""

from thermoctl.estimation.bank import LainiotisBank, Order
from thermoctl.estimation.batch import Run, run_batch
from thermoctl.estimation.belief import start
from thermoctl.estimation.fading import MatrixFading, MultipleFading
from thermoctl.estimation.guards import Guarded, GuardedEstimate
from thermoctl.estimation.identifier import Identifier, IdentifierBelief
from thermoctl.estimation.kalman import CorrectedKalman, RandomWalkKalman
from thermoctl.estimation.least_squares import RecursiveLeastSquares, VariableForgetting
from thermoctl.estimation.state_space import LinearModel, StateBelief, StateKalman
from thermoctl.signals import Estimate

__all__ = [
    "CorrectedKalman",
    "Estimate",
    "Guarded",
    "GuardedEstimate",
    "Identifier",
    "IdentifierBelief",
    "LainiotisBank",
    "LinearModel",
    "MatrixFading",
    "MultipleFading",
    "Order",
    "RandomWalkKalman",
    "RecursiveLeastSquares",
    "Run",
    "StateBelief",
    "StateKalman",
    "VariableForgetting",
    "run_batch",
    "start",
]
