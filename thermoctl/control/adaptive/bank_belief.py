"""What a bank of filters believes, and what it becomes from sample to sample."""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.control.adaptive import filters
from thermoctl.control.adaptive.coasting import Outlook
from thermoctl.control.adaptive.evidence import Drifting, Excitation, Gate, Noise, Weights
from thermoctl.control.adaptive.gains import Gains
from thermoctl.control.adaptive.path import Path
from thermoctl.quantities import Array


class BankBelief(NamedTuple):
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
    surprise_k : float
        The last reading less what the hypotheses expected, weighted as they were before it; NaN
        where there was no reading, or nothing to expect.
    full : ndarray, shape (4, 5, n) or None
        The filters after the last full sample; None before the first valid reading.
    x : ndarray, shape (4, n) or None
        Their states. They lie in `full`, unless gains have been kept since.
    gains : Gains or None
        Those of the filters in the last rest; None before it, and where more than power has moved
        since.
    outlook : Outlook or None
        What follows for control; None before the first valid reading.
    prior : Prior
        Gain and loss to begin with; once there are filters, they know better.
    twin : Twin or None
        The same, had the plant been met in the other state; None once that is settled.
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
    surprise_k: float = math.nan
    full: filters.Block | None = None
    x: Array | None = None
    gains: Gains | None = None
    outlook: Outlook | None = None
    prior: filters.Prior = filters.UNKNOWN
    twin: Twin | None = None

    @property
    def block(self) -> filters.Block | None:
        """The filters of this sample: those of `full`, with the states of now."""
        full, x = self.full, self.x
        return None if full is None or x is None else filters.joined(full, x)


class Twin(NamedTuple):
    """The same plant from another initial condition: at rest, or under full power.

    Parameters
    ----------
    belief : BankBelief
        The one of the two that does not lead.
    odds : float
        Natural logarithm of the odds that there was heat.
    heated : bool
        Whether it is `belief` that has it.
    weights, beside : Weights
        How likely the hypotheses are in `belief`, and in the one beside it, if all readings are
        evidence: what was foreseen depends on it. Only power that moves tells of lags, and for one
        of the two it has not.
    """

    belief: BankBelief
    odds: float
    heated: bool
    weights: Weights
    beside: Weights


class Prediction(NamedTuple):
    """The time update: what a period makes of a belief before its reading is seen.

    Parameters
    ----------
    excitation, path : Excitation, Path
        As in the belief to come.
    unrest : float
        How far the power was from what holds the water; 0 while that is not known.
    full : ndarray, shape (4, 5, n) or None
        The filters; None where nothing is foreseen, at the start or after a long gap. With gains
        that are kept those of the belief, as P is what it was.
    x : ndarray, shape (4, n) or None
        The states foreseen.
    gains : Gains or None
        Those that are kept; None where they are to be reckoned.
    twin : Prediction or None
        The same of the twin.
    """

    excitation: Excitation
    path: Path
    unrest: float
    full: filters.Block | None
    x: Array | None
    gains: Gains | None = None
    twin: Prediction | None = None


class Correction(NamedTuple):
    """The measurement update: the part of a belief that readings change."""

    noise: Noise
    gate: Gate
    weights: Weights
    drifting: Drifting
    heard: float
    surprise_k: float
    full: filters.Block
    x: Array
    gains: Gains | None = None
