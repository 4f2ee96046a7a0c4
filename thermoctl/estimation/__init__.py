"""What is believed about the plant, and how sure the belief is."""

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
