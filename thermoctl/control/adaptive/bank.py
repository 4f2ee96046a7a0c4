"""The bank of corrected Kalman filters: a reading goes in, a belief comes out.

Nothing is changed in place once it is part of a belief, and what belongs to one is read-only. So a
belief may be kept, compared, gone back to, and carried on twice, as any other value.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from thermoctl.control.adaptive import evidence, filters, path
from thermoctl.control.adaptive.coasting import Outlook, outlook
from thermoctl.control.adaptive.evidence import (
    EVIDENCE_FROM,
    GATE,
    GATE_SAMPLES,
    HOLD_LAGS,
    QUIET_LAGS,
    QUIET_POWER,
    QUIET_SAMPLES,
    Drifting,
    Excitation,
    Gate,
    Noise,
    Weights,
)
from thermoctl.control.adaptive.filters import X, Z
from thermoctl.control.adaptive.hypotheses import Hypotheses
from thermoctl.control.adaptive.path import Path
from thermoctl.quantities import Array, clamp, is_finite_number

LOSS_FROM_S = 60.0
"""The loss is limited by the gain from then on: before, the gain is hardly known."""
BLIND_S = 300.0
"""Without a reading for so long the filters stand still: what they would go on adding up says
nothing of the water any more. Gain, loss and weights are kept, water and sensor begin anew."""


@dataclass(frozen=True, slots=True, eq=False)
class BankBelief:
    """What the bank believes after a sample.

    Parameters
    ----------
    sample : int
        Number of the last sample; the first valid reading is 0, and before it is -1.
    blind : int
        Samples in a row without a valid reading.
    excitation, path : Excitation, Path
        How the power moved, and where it is on its way.
    noise, gate : Noise, Gate
        What the readings were like.
    weights : Weights
        How likely each hypothesis is.
    drifting : Drifting
        Whether the water drifts by itself.
    heard : float
        What the last sample counted as evidence for or against them, in [0, 1].
    block : ndarray, shape (4, 5, n) or None
        The filters; None before the first valid reading.
    outlook : Outlook or None
        What follows for control; None before the first valid reading.
    prior : Prior
        Gain and loss to begin with; once there are filters, they know better.
    """

    sample: int
    blind: int
    excitation: Excitation
    path: Path
    noise: Noise
    gate: Gate
    weights: Weights
    drifting: Drifting
    heard: float = 0.0
    block: filters.Block | None = None
    outlook: Outlook | None = None
    prior: filters.Prior = filters.UNKNOWN


class Met(NamedTuple):
    """The part of a belief that readings change."""

    noise: Noise
    gate: Gate
    weights: Weights
    drifting: Drifting
    heard: float
    block: filters.Block


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """The law of the bank.

    Parameters
    ----------
    period_s : float
        Time from one sample to the next, .05 to 3,600 s.
    u_min, u_max : float
        Least and most power: at most 0, and above it.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    period_s: float = 1.0
    u_min: float = 0.0
    u_max: float = 1.0
    hypotheses: Hypotheses = field(init=False, repr=False)
    drift: filters.Drift = field(init=False, repr=False)
    _arrivals: Mapping[int, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("u_min", "u_max"):
            if not is_finite_number(getattr(self, name)):
                raise ValueError(f"{name} must be a finite number, got {getattr(self, name)!r}")
        if self.u_min > 0.0:
            raise ValueError(f"u_min must be at most 0, got {self.u_min!r}")
        if self.u_max <= 0.0:
            raise ValueError(f"u_max must be positive, got {self.u_max!r}")
        object.__setattr__(self, "hypotheses", Hypotheses.at_period(self.period_s))
        object.__setattr__(self, "drift", filters.drift(self.period_s))
        object.__setattr__(self, "_arrivals", _arrivals(self.hypotheses))

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and most power."""
        return self.u_min, self.u_max

    def start(self) -> BankBelief:
        """Return the belief before the first sample."""
        return BankBelief(
            -1,
            0,
            Excitation(),
            path.at_rest(self.hypotheses),
            Noise(),
            Gate(),
            evidence.equal(self.hypotheses),
            Drifting(),
        )

    def observe(self, belief: BankBelief, y_c: float, applied: float) -> BankBelief:
        """Return the belief after a period of `applied` and the reading `y_c`.

        Parameters
        ----------
        belief : BankBelief
            The one before.
        y_c : float
            Reading in degC; NaN when there is none.
        applied : float
            Power that the plant really got; limited to the bounds.

        Raises
        ------
        ArithmeticError
            The result would not be finite; `belief` is still good.
        """
        hypotheses, bounds = self.hypotheses, (self.u_min, self.u_max)
        power = clamp(applied, *bounds)
        way = path.pushed(belief.path, hypotheses, power)
        excitation = belief.excitation.after(power, self.period_s)
        seen = math.isfinite(y_c)
        if belief.block is None and not seen:
            return replace(belief, path=way, excitation=excitation)
        sample, blind = belief.sample + 1, 0 if seen else belief.blind + 1
        block, unrest = self._begun(belief, y_c), _unrest(belief.outlook, power)
        if blind * self.period_s <= BLIND_S:
            block = self._ahead(block, way, sample, unrest)
        met = Met(belief.noise, belief.gate, belief.weights, belief.drifting, 0.0, block)
        if seen:
            met = self._met(met, y_c, sample, excitation.share, unrest)
        ahead = outlook(met.block, way, met.weights.share, hypotheses, bounds)
        if not math.isfinite(np.vdot(met.block, met.block) + ahead.coasting_c):
            raise ArithmeticError(f"expected a finite belief after {y_c!r} degC at {applied!r}")
        for array in (met.block, *way):
            array.setflags(write=False)
        return BankBelief(sample, blind, excitation, way, *met, ahead)

    def foreseen(self, block: filters.Block, belief: BankBelief, applied: float) -> filters.Block:
        """Return `block`, that of `belief`, as it will be after a period of `applied`."""
        power = clamp(applied, *self.bounds)
        way = path.pushed(belief.path, self.hypotheses, power)
        unrest = _unrest(belief.outlook, power)
        return filters.predicted(block, way.mean, self.hypotheses, self.drift, unrest)

    def lost(self, belief: BankBelief) -> BankBelief:
        """Return the belief after a gap of which the applied power is not known."""
        blind = max(belief.blind, math.ceil(BLIND_S / self.period_s)) + 1
        return replace(belief, blind=blind, gate=Gate(), path=path.at_rest(self.hypotheses))

    def _begun(self, belief: BankBelief, y_c: float) -> filters.Block:
        """Return the block to go on from; at the first reading and after a long gap, a new one."""
        if belief.block is None:
            return filters.start(self.hypotheses, y_c, belief.prior)
        if belief.blind * self.period_s > BLIND_S and math.isfinite(y_c):
            return filters.restarted(belief.block, self.hypotheses, y_c)
        return belief.block

    def _ahead(self, block: filters.Block, way: Path, sample: int, unrest: float) -> filters.Block:
        """Return the block predicted for `sample`."""
        block = filters.predicted(block, way.mean, self.hypotheses, self.drift, unrest)
        arrived = self._arrivals.get(sample)
        if arrived is not None:
            filters.loosened(block, way.heat, arrived)
        return block

    def _met(self, before: Met, y_c: float, sample: int, share: float, unrest: float) -> Met:
        """Return what becomes of the prediction when the reading `y_c` meets it."""
        noise, gate, weights, drifting, heard, block = before
        noise = noise.after(y_c)
        R, m = noise.believed, weights.likeliest
        nu, S_m = y_c - float(block[Z, X, m]), float(block[Z, Z, m]) + R
        lag = float(self.hypotheses.lag_s[m]) / self.period_s
        if before.noise.samples >= GATE_SAMPLES and nu * nu > GATE * S_m:
            gate = gate.beyond(sample, HOLD_LAGS * lag)
        else:
            gate = gate.within()
        if gate.outlier:
            return Met(noise, gate, weights, drifting, heard, block)
        if sample >= drifting.silent_until:
            still, rest = (
                share == 0.0 and unrest < QUIET_POWER,
                max(QUIET_LAGS * lag, QUIET_SAMPLES),
            )
            drifting = drifting.after(still, nu / math.sqrt(S_m), rest)
        if gate.jumped:
            block = filters.inflated(block, nu, R)
            drifting = Drifting(silent_until=gate.silent_until, disturbed=True)
        elif drifting.found:
            filters.reopened(block)
            drifting = Drifting(silent_until=sample + HOLD_LAGS * lag, disturbed=True)
        block, nus, S = filters.corrected(block, y_c, R, share)
        filters.project(
            block, self.hypotheses, self.u_min, loss=sample * self.period_s > LOSS_FROM_S
        )
        silent_until = max(EVIDENCE_FROM, gate.silent_until, drifting.silent_until)
        if share > 0.0 and sample >= silent_until and not drifting.suspected:
            weights, heard = weights.after(share, nus, S), share
        elif sample < gate.silent_until and not gate.jumped:
            weights = weights.among_shapes(nus, S)
        return Met(noise, gate, weights, drifting, heard, block)


def _arrivals(hypotheses: Hypotheses) -> Mapping[int, Array]:
    """Return, by sample, under which hypotheses the heat has just arrived."""
    samples = np.floor(filters.LOSS_LAGS * hypotheses.lag_s / hypotheses.period_s) + 1.0
    return {int(sample): samples == sample for sample in np.unique(samples)}


def _unrest(outlook: Outlook | None, power: float) -> float:
    """Return how far `power` was from what holds the water; 0 while that is not known."""
    return 0.0 if outlook is None else abs(power - outlook.holding_power)
