"""Self-tuning generalized predictive control, Clarke, Mohtadi and Tuffs (1987).

Implements section 10 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np

from thermoctl.control.gpc.beyond import Beyond
from thermoctl.control.gpc.doubt import Doubt
from thermoctl.control.gpc.learning import Learner, Learnt
from thermoctl.control.gpc.model import ChangeModel
from thermoctl.control.gpc.moves import best_powers
from thermoctl.control.gpc.record import Record
from thermoctl.control.minimum_variance import HOLDING_SD_MAX, RIDE_MAX_S
from thermoctl.control.mirror import mirrored
from thermoctl.ports import Situation
from thermoctl.quantities import Array, clamp, is_finite_number
from thermoctl.ranges import require
from thermoctl.signals import Beliefs

MOVES_MAX = 6
BLOCKS_MAX, SAMPLES_MAX = 200, 1000
"""Largest number of blocks in a horizon, and of samples in a block: a cycle has to end."""
RIDE_LAGS = 3.0
BLIND_S = 300.0
"""Time in s without a reading after which the record begins anew; what was learnt is kept."""
UNKNOWN_S, UNKNOWN_PERIODS = 60.0, 10.0
"""Gap in s, and in periods, beyond both of which nobody knows what was applied: commands expire."""
TRUST_S = 900.0
"""Time constant in s of the mean power that is given in doubt."""


@dataclass(frozen=True, slots=True, eq=False)
class GpcBelief:
    """What the controller remembers.

    Parameters
    ----------
    record : Record
        The latest readings and powers.
    learnt : Learnt
        The model.
    behind_s, given_s : float
        Time by which the record is behind, and the applied power integrated over the part of it
        that came in intervals too short for a sample.
    since_s : float
        Length of that part.
    doubt : Doubt
        Whether power seems to warm nothing.
    trusted : float
        Mean power while there was no doubt.
    before : tuple of Record and Learnt, or None
        What was known a period before this sample; None where that was nothing, or not one period.
    """

    record: Record
    learnt: Learnt
    behind_s: float = 0.0
    given_s: float = 0.0
    since_s: float = 0.0
    doubt: Doubt = field(default_factory=Doubt)
    trusted: float = 0.0
    before: tuple[Record, Learnt] | None = None


@dataclass(frozen=True, slots=True)
class SelfTuningGpc:
    r"""Learn an ARX model and take the powers that cost least over a horizon ahead.

    .. math::

        J = \sum_{j=1}^{N} (\hat y(t+j) - r)^2 + N \sum_{k=2}^{4} (\hat z(t+kN) - r)^2
            + \lambda \sum_{i=1}^{N_u} \Delta u_i^2

    The model is one of block means; it is learnt at every sample, whoever steers, and needs no
    settings. Only the first of the powers is given, and at the next sample all is computed anew.

    Parameters
    ----------
    n : int
        Poles of the model, 1 to 3; one of them is 1, and the loss is learnt beside it.
    m : int
        Inputs of the model, 1 to 12. More than the lag needs make up for a delay not known.
    delay : int
        Blocks from a power to its first effect, 1 to 60.
    model_period_s : float
        Length of a block, about half of the lag; at least one period is taken.
    horizon_s : float
        How far it looks ahead through the model: longer than most of the lag, at most 200 blocks.
        Three times as far again it counts heat alone.
    moves : int
        Blocks with a power of their own, 1 to 6; the last of these powers is kept to the end.
    move_weight : float
        lambda over the square of what full power does in a block; more is calmer; from 0 to 1e6.
    gain_k_per_s : float
        First guess of what full power does, in K/s; that of the loop's model. A twentieth of the
        truth or twenty times as much will do.
    power_max : float
        Most power it plans with, in (0, 1]; that of the loop.
    period_s : float
        Time between two samples, as the loop has it.
    action : {'heat', 'cool'}
        What power does to the plant.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    n: int = 3
    m: int = 3
    delay: int = 1
    model_period_s: float = 10.0
    horizon_s: float = 150.0
    moves: int = 3
    move_weight: float = 10.0
    gain_k_per_s: float = 0.02
    power_max: float = 1.0
    period_s: float = 1.0
    action: Literal["heat", "cool"] = "heat"
    learner: Learner = field(init=False, repr=False, compare=False)
    length: int = field(init=False, repr=False, compare=False)
    beyond: Beyond = field(init=False, repr=False, compare=False)

    name: ClassVar[str] = "self-tuning-gpc"

    def __post_init__(self) -> None:
        model = ChangeModel(self.n, self.m, self.delay)
        ranges = {
            "model_period_s": (0.05, 3600.0),
            "move_weight": (0.0, 1e6),
            "gain_k_per_s": (1e-6, 10.0),
            "period_s": (0.05, 3600.0),
        }
        for name, (low, high) in ranges.items():
            require(name, getattr(self, name), low, high)
        if not is_finite_number(self.power_max) or not 0.0 < self.power_max <= 1.0:
            raise ValueError(f"power_max must lie in (0, 1], got {self.power_max!r}")
        if self.action not in ("heat", "cool"):
            raise ValueError(f"action must be 'heat' or 'cool', got {self.action!r}")
        size = max(1, round(self.model_period_s / self.period_s))
        if size > SAMPLES_MAX:
            most_s = SAMPLES_MAX * self.period_s
            raise ValueError(
                f"model_period_s must be at most {most_s:g}, got {self.model_period_s!r}"
            )
        self._check_horizon(model)
        block_s = size * self.period_s
        learner = Learner(model, self.gain_k_per_s * block_s, size, block_s)
        length = max(round(self.horizon_s / block_s), model.u_memory + 1, self.moves)
        object.__setattr__(self, "learner", learner)
        object.__setattr__(self, "length", length)
        object.__setattr__(self, "beyond", Beyond(length, self.moves))

    def _check_horizon(self, model: ChangeModel) -> None:
        """Refuse a horizon within which a power would not show."""
        least_s = (model.u_memory + 1) * self.model_period_s
        most_s = BLOCKS_MAX * self.model_period_s
        if not is_finite_number(self.horizon_s) or not least_s <= self.horizon_s <= most_s:
            raise ValueError(
                f"horizon_s must lie in [{least_s:g}, {most_s:g}], from one block more than the "
                f"powers of the model to {BLOCKS_MAX} blocks, got {self.horizon_s!r}"
            )
        moves, whole = self.moves, not isinstance(self.moves, bool) and isinstance(self.moves, int)
        if not whole or not 1 <= moves <= MOVES_MAX:
            raise ValueError(f"moves must be an integer from 1 to {MOVES_MAX}, got {moves!r}")

    def start(self) -> GpcBelief:
        """Return the belief before the first sample: nothing is known."""
        return GpcBelief(Record(), self.learner.start())

    def observe(self, belief: GpcBelief, situation: Situation) -> GpcBelief:
        """Return the belief after this sample, whoever steers."""
        h, interval_s = self.period_s, situation.interval_s
        reading_c = self._seen(situation).measured_c
        since_s, given_s = belief.since_s + interval_s, belief.given_s
        given_s += situation.applied * interval_s
        power = given_s / since_s if belief.since_s > 0.0 else situation.applied
        power = clamp(power, 0.0, 1.0)
        if interval_s > max(UNKNOWN_S, UNKNOWN_PERIODS * h):
            return replace(belief, record=self._begun(reading_c, 0.0), behind_s=0.0, before=None)
        behind_s = belief.behind_s + interval_s
        periods = math.floor(behind_s / h + 0.5)
        if not belief.record.has_begun:
            return replace(belief, record=self._begun(reading_c, 0.0))
        if periods < 1:
            return replace(belief, behind_s=behind_s, given_s=given_s, since_s=since_s, before=None)
        one = periods == 1 and belief.since_s == 0.0
        before = (belief.record, belief.learnt) if one else None
        behind_s -= periods * h
        belief = replace(belief, behind_s=behind_s, given_s=0.0, since_s=0.0, before=before)
        for _ in range(periods - 1):
            belief = self._met(belief, math.nan, power)
        return self._met(belief, reading_c, power)

    def _begun(self, reading_c: float, power: float) -> Record:
        """Return a record that begins now, or an empty one where there is no reading."""
        if not math.isfinite(reading_c):
            return Record()
        return Record.begun(self.learner.model.memory * self.learner.size, reading_c, power)

    def _met(self, belief: GpcBelief, reading_c: float, power: float) -> GpcBelief:
        """Return the belief one period later."""
        record, learnt, learner = belief.record, belief.learnt, self.learner
        if record.blind * self.period_s > BLIND_S:
            record = self._begun(reading_c, power)
            return replace(belief, record=record if record.has_begun else belief.record)
        if not math.isfinite(reading_c):
            record = record.blinded(self._expected_c(record, learnt, power), power)
        else:
            record = record.after(reading_c, power)
        changes_k, powers = self._pasts(record)
        if record.whole:
            phi = learner.model.regressor(changes_k[1:], powers)
            learnt = learner.update(learnt, float(changes_k[0]), phi, float(powers[0]))
        else:
            learnt = learner.passed(learnt, float(powers[0]))
        share = float(powers[0]) / self.power_max
        doubt = belief.doubt.after(self._mean_c(record), share, learner.size)
        trusted = belief.trusted
        if doubt.samples == 0:
            trusted += (power - trusted) * min(self.period_s / TRUST_S, 1.0)
        return replace(belief, record=record, learnt=learnt, doubt=doubt, trusted=trusted)

    def _mean_c(self, record: Record) -> float:
        """Return the mean of the newest block."""
        return float(record.readings_c[: self.learner.size].sum()) / self.learner.size

    def _pasts(self, record: Record) -> tuple[Array, Array]:
        """Return changes of block means and mean powers, newest first."""
        model, size = self.learner.model, self.learner.size
        means_c = record.means_c(model.n + 1, size)
        return means_c[:-1] - means_c[1:], record.mean_powers(model.u_memory, size)

    def _expected_c(self, record: Record, learnt: Learnt, power: float) -> float:
        """Return the next reading as the model has it, after a period of `power`.

        The change from block to block is divided evenly among its samples.
        """
        model, size = self.learner.model, self.learner.size
        changes_k, powers = self._pasts(record)
        powers[0] += (power - float(record.powers[size - 1])) / size
        change_k = float(model.regressor(changes_k, powers) @ learnt.theta)
        return self._mean_c(record) + change_k * 0.5 * (size + 1.0) / size

    def decide(self, belief: GpcBelief, situation: Situation) -> tuple[GpcBelief, float]:
        """Return the first of the powers that cost least; NaN when nothing is known."""
        setpoint_c, record = self._seen(situation).setpoint_c, belief.record
        if not record.has_begun or not math.isfinite(setpoint_c):
            return belief, math.nan
        learner, theta = self.learner, belief.learnt.theta
        model, length = learner.model, self.length
        changes_k, powers = self._pasts(record)
        error_k, gain_k = setpoint_c - self._mean_c(record), model.gain_k(theta)
        errors_k = error_k - np.array(model.foreseen(theta, changes_k, powers, 0.0, length))
        step_k = np.array(model.step_response(theta, length))
        weight = self.move_weight * gain_k * gain_k
        holding = model.holding(theta)
        rest_k = error_k - model.under_way_k(theta, changes_k, powers - holding)
        later = self.beyond.cost(rest_k, gain_k * holding, gain_k)
        last, most = float(powers[0]), self.power_max
        best = best_powers(errors_k, step_k, self.moves, weight, last, most, later)
        power = clamp(float(best[0]), 0.0, self.power_max)
        doubted = belief.doubt.holds_back(learner.size)
        return belief, min(power, belief.trusted) if doubted else power

    def _gain_sd_k(self, learnt: Learnt) -> float:
        """Return the standard deviation of the gain, by linearisation."""
        model, theta = self.learner.model, learnt.theta
        left = 1.0 + float(theta[: model.n - 1].sum())
        slope = np.full(model.parameters, 1.0 / left)
        slope[: model.n - 1] = -model.gain_k(theta) / left
        slope[-1] = 0.0
        return _sd(learnt.P, slope)

    def _holding_sd(self, learnt: Learnt) -> float:
        """Return the standard deviation of the holding power, by linearisation."""
        model, theta = self.learner.model, learnt.theta
        inputs = float(theta[model.inputs].sum())
        slope = np.zeros(model.parameters)
        slope[model.inputs] = -model.holding(theta) / inputs
        slope[-1] = 1.0 / inputs
        return _sd(learnt.P, slope)

    def _lag_s(self, learnt: Learnt) -> float:
        """Return the lag of the model without that of its own means."""
        size = self.learner.size
        lag = self.learner.model.lag(learnt.theta) * size - 0.5 * (size - 1.0)
        return max(lag, 0.0) * self.period_s

    def surprise_k(self, belief: GpcBelief, situation: Situation) -> float:
        """Return reading minus what the model expected; NaN beyond one period."""
        if belief.before is None:
            return math.nan
        expected_c = self._expected_c(*belief.before, clamp(situation.applied, 0.0, 1.0))
        return self._sign * (self._seen(situation).measured_c - expected_c)

    def beliefs(self, belief: GpcBelief, situation: Situation) -> Beliefs:
        """Return gain with its error, lag, and holding power once it is known to 0.05."""
        learnt, learner = belief.learnt, self.learner
        if not belief.record.has_begun:
            return Beliefs()
        known = self._holding_sd(learnt) <= HOLDING_SD_MAX
        holding = clamp(learner.model.holding(learnt.theta), 0.0, 1.0) if known else None
        gain = self._sign * learner.model.gain_k(learnt.theta) / learner.block_s
        gain_sd = self._gain_sd_k(learnt) / learner.block_s
        return Beliefs(gain, gain_sd, holding_power=holding, lag_s=self._lag_s(learnt))

    def ride_s(self, belief: GpcBelief) -> float:
        """Return three lags, at most 60 s; 0 before the first reading and in doubt."""
        if not belief.record.has_begun or belief.doubt.stands:
            return 0.0
        return min(RIDE_LAGS * self._lag_s(belief.learnt), RIDE_MAX_S)

    def remarks(self, belief: GpcBelief) -> Mapping[str, str]:
        """Return whether power seems to warm nothing: no heater, or one wired to cool."""
        return {"controller.gain_doubtful": belief.doubt.text} if belief.doubt.stands else {}

    @property
    def _sign(self) -> float:
        """+1 or -1: to a cooler everything looks upside down, but for its power."""
        return 1.0 if self.action == "heat" else -1.0

    def _seen(self, situation: Situation) -> Situation:
        return mirrored(situation) if self.action == "cool" else situation


def _sd(P: Array, slope: Array) -> float:
    """Return the standard deviation of ``slope' theta``."""
    return math.sqrt(max(float(slope @ P @ slope), 0.0))
