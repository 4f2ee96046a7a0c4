"""What a sample says: how noisy, how exciting, an outlier or a jump.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from thermoctl.control.adaptive.colour import WHITE, Colour
from thermoctl.control.adaptive.constants import Hearing
from thermoctl.control.adaptive.hypotheses import SHAPES, Hypotheses
from thermoctl.quantities import Array, clamp, frozen

USUAL = Hearing()
GATE_SAMPLES = 20
"""Number of valid samples before the gate closes: they show what is likely."""

# -- noise ----------------------------------------------------------------------------------------

NOISE_START_K2 = 0.001
NOISE_MIN_K2 = 1e-5
"""Least variance of the noise in K², 3 mK: the model is no better than that."""
_SPREAD = 6.0  # variance of y - 2 y1 + y2 in units of the noise's: 1 + 4 + 1
_MOST = 9.0  # a second difference counts as three standard deviations at most
_MEMORY, _SETTLED = 0.005, 195  # of 200 samples; from there on 1 / (n + 5) is less
NEARER = 0.9
"""Share of the way from the coldest reading that counts. Radiation, vapour and walls that warm let
a loss grow faster than in proportion, as if the surroundings were nearer."""
_ROUNDED = 12.0  # the square of a step over the variance of what is rounded to it


class Noise(NamedTuple):
    """Variance of the readings, from their second differences: warming is not noise.

    Where readings come in steps there may be no second difference at all, and no noise either for
    who looks at them alone. So a reading that repeats shows that they do, and that none is known
    to better than the least step there was between two of them. Readings that are finer than their
    noise never repeat, or else the least step is soon far below the noise.

    Parameters
    ----------
    variance : float
        The estimate in K^2; `believed` is what filters take.
    last_c, before_last_c : float
        The valid readings before.
    samples : int
        How many readings were valid.
    step_k : float
        The least difference between a reading and the one before, of those that differed.
    repeats : bool
        Whether a reading was ever the same as the one before: they come in steps.
    least : float
        The least variance that is believed, in K^2: that of rounding to such steps.
    colour : Colour
        What of the noise is not white.
    coldest_c : float
        The coldest that three readings in a row did not exceed; two are outliers. Surroundings are
        no warmer than what only they cool.
    """

    variance: float = NOISE_START_K2
    last_c: float = math.nan
    before_last_c: float = math.nan
    samples: int = 0
    step_k: float = math.inf
    repeats: bool = False
    least: float = NOISE_MIN_K2
    colour: Colour = WHITE
    coldest_c: float = math.inf

    def after(self, y_c: float, nu: float = math.nan, hearing: Hearing = USUAL) -> Noise:
        """Return the noise after the valid reading `y_c`.

        Parameters
        ----------
        y_c : float
            The reading in degC.
        nu : float
            By how much the likeliest hypothesis missed it; NaN where that says nothing of noise.
        hearing : Hearing
            What is taken for white.
        """
        variance, last_c, before_last_c, n, step_k, repeats, least, colour, coldest_c = self
        if n >= 2:
            second = y_c - 2.0 * last_c + before_last_c
            square = second * second / _SPREAD
            most = _MOST * (NOISE_START_K2 if variance < NOISE_START_K2 else variance)
            rate = _MEMORY if n >= _SETTLED else 1.0 / (n + 5.0)
            variance += ((most if most < square else square) - variance) * rate
            if y_c < coldest_c:
                coldest_c = min(coldest_c, max(y_c, last_c, before_last_c))
        moved_k, news = abs(y_c - last_c), False
        if moved_k == 0.0:
            news = not repeats
            repeats = True
        elif moved_k < step_k:
            news, step_k = True, moved_k
        if news and repeats and step_k < hearing.noise_most_k:
            least = max(step_k * step_k / _ROUNDED, NOISE_MIN_K2)
        if n >= GATE_SAMPLES and abs(nu) < hearing.noise_most_k:
            colour = colour.after(nu, variance, hearing)
        return Noise(variance, y_c, last_c, n + 1, step_k, repeats, least, colour, coldest_c)

    def anew(self, y_c: float) -> Noise:
        """Return the noise of a plant of which nothing but `y_c` has been read."""
        return Noise(coldest_c=self.coldest_c).after(y_c)

    @property
    def above_k(self) -> float:
        """How far the last reading was above its surroundings; NaN or < 0: not known."""
        return NEARER * (self.last_c - self.coldest_c)

    @property
    def stands(self) -> bool:
        """Whether readings have repeated and never differed.

        They say nothing then: a reading that has not left its step is not at rest.
        """
        return self.repeats and self.step_k == math.inf

    @property
    def believed(self) -> float:
        """The variance that filters are told, R of their equations."""
        variance, least = self.variance, self.least
        return (least if variance < least else variance) + self.colour.variance


UNHEARD = Noise()
"""Before the first reading."""


# -- excitation -----------------------------------------------------------------------------------


class Excitation(NamedTuple):
    """How much the power moves, and so how much a sample proves.

    Parameters
    ----------
    mean_power : float
        Running mean of the power over some time, or longer in a slow plant.
    share : float
        What the last sample counts as evidence, in [0, 1].
    """

    mean_power: float = 0.0
    share: float = 0.0

    def after(
        self, power: float, period_s: float, memory_s: float = 0.0, hearing: Hearing = USUAL
    ) -> Excitation:
        """Return that after a period of `power`; the mean is of `memory_s` at least."""
        away, dead = power - self.mean_power, hearing.dead_zone
        share = clamp((abs(away) - dead) / dead, 0.0, 1.0)
        if memory_s < hearing.memory_s:
            memory_s = hearing.memory_s
        if memory_s < period_s:
            memory_s = period_s
        return Excitation(self.mean_power + period_s / memory_s * away, share)


# -- outliers and jumps ---------------------------------------------------------------------------

OUTLIERS = 2
"""Number of samples in a row outside the gate that are ignored; one more, and the water has
jumped."""


class Gate(NamedTuple):
    """Samples outside in a row, and the sample before which there is no evidence."""

    outside: int = 0
    silent_until: float = -math.inf

    @property
    def outlier(self) -> bool:
        """Whether the last sample was to be used by no filter."""
        return 0 < self.outside <= OUTLIERS

    @property
    def jumped(self) -> bool:
        """Whether the last sample showed the water somewhere else."""
        return self.outside > OUTLIERS

    def within(self) -> Gate:
        """Return the gate after a sample inside."""
        return self if self.outside == 0 else Gate(0, self.silent_until)

    def beyond(self, sample: int, hold: float) -> Gate:
        """Return the gate after a sample outside; a jump is silent for `hold` samples."""
        outside = self.outside + 1
        return Gate(outside, sample + hold if outside > OUTLIERS else self.silent_until)


# -- drifts ---------------------------------------------------------------------------------------

QUIET_SAMPLES = 20
"""Least number of samples of a rest."""
DRIFTS = 0.5
"""Allowance of the two sums, in standard deviations; they find innovations that are off by twice
this."""


class Drifting(NamedTuple):
    """Whether the water drifts by itself: a loss that is not what it was.

    A controller answers to a drift with power, and power that follows the reading looks like a slow
    plant: of all hypotheses the longest lags would win. So two sums are kept as in a CUSUM test,
    of what innovations have in excess. They run where power has been steady, which is when only a
    loss can have changed, and from a disturbance on until it is so again.

    Parameters
    ----------
    calm : int
        Samples since power moved.
    above, below : float
        The sums, in standard deviations.
    silent_until : float
        The sample before which a disturbance is being learnt, and power proves nothing.
    disturbed : bool
        Whether power has not been steady since the last one.
    suspected : bool
        Whether power that moves now may well answer to a drift, and so proves nothing.
    found : bool
        Whether the water drifts.
    """

    calm: int = 0
    above: float = 0.0
    below: float = 0.0
    silent_until: float = -math.inf
    disturbed: bool = False
    suspected: bool = False
    found: bool = False

    def after(self, still: bool, nu: float, rest: float, hearing: Hearing = USUAL) -> Drifting:
        """Return the sums after one more innovation.

        Parameters
        ----------
        still : bool
            Whether the power is steady, and about what holds the water.
        nu : float
            The innovation over its standard deviation.
        rest : float
            Samples of it after which the water is at rest.
        hearing : Hearing
            What makes a sum suspicious, and what proves it.
        """
        calm = self.calm + 1 if still or self.suspected else 0
        disturbed = self.disturbed and calm < rest
        if calm < rest and not disturbed:
            return Drifting(calm, silent_until=self.silent_until)
        above, below = self.above + nu - DRIFTS, self.below - nu - DRIFTS
        above, below = 0.0 if above < 0.0 else above, 0.0 if below < 0.0 else below
        most = below if above < below else above
        suspected, found = most > hearing.suspected_sds, most > hearing.drifted_sds
        return Drifting(calm, above, below, self.silent_until, disturbed, suspected, found)


# -- weights --------------------------------------------------------------------------------------

SURPRISE_MAX = 9.0
"""Most that one sample costs a hypothesis: the square of three standard deviations."""
FLOOR = -30.0
"""Least log weight, so that a hypothesis can return within tens of seconds."""
EVIDENCE_FROM = 4
"""Number of samples at the start that are no evidence: the filters have not met the sensor yet."""


class Weights(NamedTuple):
    """How likely each hypothesis is.

    Parameters
    ----------
    log : ndarray, shape (n,)
        Log of the weight, 0 for the likeliest, at least `FLOOR`.
    share : ndarray, shape (n,)
        The same as probabilities: they add up to 1.
    likeliest : int
        The hypothesis with log 0, the first of equals.
    """

    log: Array
    share: Array
    likeliest: int

    def after(self, e: float, nis: Array, S: Array) -> Weights:
        """Return the weights after a reading, counted as `e`.

        Parameters
        ----------
        e : float
            What it proves, in [0, 1].
        nis, S : ndarray, shape (n,)
            The innovations squared over their variances, and these.
        """
        log = _likelihood(nis, S, e)
        log += self.log  # ALF (6)-(7), in logarithms
        return weighted(log)

    def tempered(self, factor: float) -> Weights:
        """Return the weights had all evidence counted `factor` of what it did."""
        return weighted(factor * self.log)

    def among_shapes(self, nis: Array, S: Array) -> Weights:
        """Return the weights after innovations that speak of shapes alone.

        Of each lag all shapes together keep the weight they had.
        """
        log = _likelihood(nis, S, 1.0).reshape(-1, len(SHAPES))
        before = self.share.reshape(-1, len(SHAPES))
        log -= log.max(axis=1, keepdims=True)
        after = before * np.exp(log)
        log += np.log(before.sum(axis=1, keepdims=True) / after.sum(axis=1, keepdims=True))
        each = log.reshape(-1)
        each += self.log
        return weighted(each)


def _likelihood(nis: Array, S: Array, e: float) -> Array:
    """Return `e` times the log likelihood, without constants; `nis` is nu^2 / S."""
    log = np.log(S)
    log += np.minimum(nis, SURPRISE_MAX)
    log *= -0.5 * e
    return log


def weighted(log: Array) -> Weights:
    """Return the weights of these logarithms, which become theirs."""
    likeliest = int(log.argmax())
    log -= log[likeliest]
    np.maximum(log, FLOOR, out=log)
    share = np.exp(log)
    share /= share.sum()
    return Weights(frozen(log), frozen(share), likeliest)


def equal(hypotheses: Hypotheses) -> Weights:
    """Return the weights before any evidence."""
    return weighted(np.zeros(len(hypotheses)))
