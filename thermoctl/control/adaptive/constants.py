"""Every constant of the law that a plant could want otherwise, with its range.

None met so far did; ``docs/sensitivity.md`` halves and doubles them. What is not here is
arithmetic, such as the limit on what one sample may say, or is forgotten within minutes, such as
the first guess of the gain.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thermoctl.quantities import Array
from thermoctl.ranges import check_ranges, ranged


@dataclass(frozen=True, slots=True)
class Lags:
    """Which total lags a plant may have, from heater to reading; in equal ratios.

    What full power has under way is known as well as the lag. The ratios are of 1.185; with 1.30, a
    plant half-way between two was now taken for the one and now for the other.

    Parameters
    ----------
    shortest_s : float
        Shortest lag. A quicker plant is treated as one of this lag, and held more calmly than need
        be.
    longest_s : float
        Longest lag, above the shortest. A slower plant overshoots.
    count : int
        Number of lags. A wider range wants more of them.
    pipe_beyond_s : float
        In one of the shapes, the part of a lag beyond this time of heater and sensor together is
        dead time: a pipe. 20 s suit a vessel; a share in its place would give short lags a dead
        time that no plant without a pipe has.

    Raises
    ------
    ValueError
        One of them lies outside its range, or the longest is not above the shortest.
    """

    shortest_s: float = ranged(3.0, 0.1, 86_400.0)
    longest_s: float = ranged(150.0, 0.1, 86_400.0)
    count: int = ranged(24, 2, 96)
    pipe_beyond_s: float = ranged(20.0, 0.1, 86_400.0)

    def __post_init__(self) -> None:
        check_ranges(self)
        if not self.longest_s > self.shortest_s:
            raise ValueError(
                f"longest_s must be above shortest_s, {self.shortest_s:g}, got {self.longest_s!r}"
            )

    @property
    def each_s(self) -> Array:
        """All of them in s, shape (count,)."""
        ratio = self.longest_s / self.shortest_s
        lags_s: Array = self.shortest_s * ratio ** (np.arange(self.count) / (self.count - 1.0))
        return lags_s


@dataclass(frozen=True, slots=True)
class Plants:
    """What is taken for granted of a plant: how it drifts, what a heater can do.

    A share is a share of the gain, the rise in a second at full power: so half a litre and 200 are
    alike.

    Parameters
    ----------
    water_drift, loss_drift, gain_drift : float
        Noise of the water's temperature, the loss and the gain in a second, as shares.
    sensor_drift_k : float
        Noise of the sensor's temperature in a second.
    unrest : float
        Growth of the noise of the loss per full range between power and holding power: water on its
        way to another temperature, glass and air behind it, loses what it did not lose before.
    room_k : float
        A loss grows with the temperature as if the surroundings were this much colder, or by .9 of
        how much colder the plant ever was, if that is more and nothing but them cools it. Left to
        the noise of the loss, it would have to be learnt anew at every set point. Most surroundings
        are nearer, and the loss grows faster.
    loosened_lags, loosened_share : float
        After this many lags the heat has arrived, and the gain is known well enough to limit the
        loss: gain and loss then become uncertain by this share.
    reopened_share : float
        Uncertainty of a loss that has changed, as a share.
    rescaled_share : float
        Or loss and gain have both changed, by a factor with this standard deviation: there is less
        water.
    known_share : float
        A gain is known once its standard deviation is at most this share of it.
    gain_min_k_per_s : float
        Least gain of a heater: 17 W in 200 l of water.
    heat_max_k : float
        Most heat that full power has under way: a gain is at most this over the lag. A quicker
        plant is held as if it were no quicker. A single limit for the gains of all lags would
        either admit no quick plant, or let a long lag with an impossible gain explain a warm-up as
        well as the truth does.

    Raises
    ------
    ValueError
        One of them lies outside its range.
    """

    water_drift: float = ranged(0.08, 1e-8, 10.0)
    loss_drift: float = ranged(0.0008, 1e-8, 10.0)
    gain_drift: float = ranged(2e-4, 1e-8, 10.0)
    sensor_drift_k: float = ranged(0.003, 1e-8, 10.0)
    unrest: float = ranged(5.0, 0.0, 100.0)
    room_k: float = ranged(40.0, 1.0, 1e6)
    loosened_lags: float = ranged(2.0, 0.1, 100.0)
    loosened_share: float = ranged(0.08, 0.0, 1.0)
    reopened_share: float = ranged(0.05, 0.0, 1.0)
    rescaled_share: float = ranged(0.1, 0.0, 1.0)
    known_share: float = ranged(0.1, 0.0, 1.0)
    gain_min_k_per_s: float = ranged(2e-5, 1e-8, 0.1)
    heat_max_k: float = ranged(60.0, 0.01, 1e5)

    def __post_init__(self) -> None:
        check_ranges(self)


@dataclass(frozen=True, slots=True)
class Hearing:
    """What a sample is worth as evidence, and which samples are nobody's.

    Parameters
    ----------
    dead_zone : float
        Distance of the power from its mean within which a sample proves nothing. In quiet
        regulation ln S alone would count, always in favour of a small gain, and a small vessel
        would drift to a wrong hypothesis.
    memory_s, memory_lags : float
        Time constant of that mean: in s and in lags, the longer of the two. A move of the power
        proves something when its heat arrives; if the mean had followed by then, it would not
        count. A slow plant, first taken for a still slower one, would then be steered so calmly
        that the guess is never corrected.
    gate_sds : float
        Standard deviations beyond which an innovation is outside and ignored, unless it lasts.
    hold_lags : float
        Number of lags after a jump in which nothing is evidence about lags, or it would be read as
        a change of lag. Evidence about shapes counts: how fast the reading follows is the sensor
        alone.
    quiet_lags, quiet_power : float
        After this many lags of steady power nothing is under way any more, if the power is this
        close to the holding power: a warm-up is steady too, and no rest.
    suspected_sds, drifted_sds : float
        Limits for sums of innovations. Beyond the first, a power that moves is no evidence; beyond
        the second, the loss has changed. Sums of white ones are beyond 3 for 6 % of the time, and
        reach 14 three times in ten million samples: about once in 40 days without a move of the
        power.
    noise_most_k : float
        An innovation beyond this is no noise, and a move beyond it no step of the readings: it is
        the plant, unlike what is believed of it. Eight bits of 100 K are 0.39 K.
    white : float
        Largest correlation of an innovation with the next one for which the noise counts as white.
        With 0.3 a plant that is unlike any hypothesis, such as a lab of 4 g, is taken for a hum,
        and with 0.5 a hum is taken for a plant.
    colour_times : float
        Factor with which the correlated rest counts as noise: innovations are what the filters have
        left of it.
    colour_samples : float
        Memory of that rest, in samples. A sensor hums for as long as it is there; with 200, ice
        that melts was taken for a hum, and found three times as late.
    onset_s : float
        Time in which it is open whether power was full before the first reading, or none.
    onset_odds : float
        Log odds beyond which it was full, 2.7 to 1: most plants are met at rest.
    onset_most : float
        Most that one reading adds to these log odds: little is known of the noise yet.

    Raises
    ------
    ValueError
        One of them lies outside its range.
    """

    dead_zone: float = ranged(0.05, 1e-4, 1.0)
    memory_s: float = ranged(50.0, 1.0, 1e5)
    memory_lags: float = ranged(2.0, 0.1, 100.0)
    gate_sds: float = ranged(5.0, 2.0, 100.0)
    hold_lags: float = ranged(5.0, 0.1, 100.0)
    quiet_lags: float = ranged(3.0, 0.1, 100.0)
    quiet_power: float = ranged(0.15, 0.0, 1.0)
    suspected_sds: float = ranged(3.0, 0.1, 1e6)
    drifted_sds: float = ranged(14.0, 1.0, 1e6)
    noise_most_k: float = ranged(0.5, 1e-3, 100.0)
    white: float = ranged(0.4, 0.0, 0.99)
    colour_times: float = ranged(2.0, 0.0, 100.0)
    colour_samples: float = ranged(1000.0, 10.0, 1e7)
    onset_s: float = ranged(30.0, 0.0, 1e5)
    onset_odds: float = ranged(1.0, 0.0, 100.0)
    onset_most: float = ranged(0.6, 0.0, 100.0)

    def __post_init__(self) -> None:
        check_ranges(self)
        least = self.suspected_sds
        if not self.drifted_sds > least:
            raise ValueError(
                f"drifted_sds must be above suspected_sds, {least:g}, got {self.drifted_sds!r}"
            )


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast an error is answered, and what of the heat under way counts.

    Parameters
    ----------
    fastest_s, fastest_periods : float
        Least Tc, in s and in samples, whatever the lag: at one sample any error of the gain would
        be given back whole, and below it the loop would be unstable.
    lag_floor_s, lag_floor_share : float
        Least uncertainty of the lag: this time and this share of it together, whatever the weights
        say, since no plant is quite like any hypothesis.
    mistaken_k, calmer : float
        What full power heats in the time by which the lag may be mistaken comes as overshoot. Where
        that exceeds `mistaken_k`, Tc grows in proportion, by the factor `calmer` at most.
    smoothness : float
        Lag of the power itself, as a share of Tc. Noise then moves the heater a good deal less,
        while a power that has far to go is at its limit at once all the same.
    left_out, even, heavy_k : float
        Share of the heat in the heater that is left out of account on the move. If all of it
        counted, the error would go by Tc and the water follow as slowly as the heater; so both go
        at one pace, damped by some 0.85. A lag that is mistaken then costs more: where the range of
        power has `even` times `heavy_k` under way within a lag all of that heat counts, and beyond
        it even more.
    resting, rest_power : float
        Factor with which that heat counts where the power is within `rest_power` of the holding
        power. At rest it is the answer to noise that has passed, and what is taken back of it need
        not be cooled away.
    vague_share, vague_k_per_s : float
        A gain is taken to be larger by what its standard deviation, `vague_k_per_s` of it at most,
        exceeds `vague_share` of it. Otherwise a start in water that is nearly warm would ask for
        all the power there is.
    caution, agreed_k : float
        The error that is acted on is less by `caution` standard deviations among the hypotheses
        beyond `agreed_k`. What they disagree in is heat on its way. When it has arrived they agree:
        nothing waits for ever.

    Raises
    ------
    ValueError
        One of them lies outside its range.
    """

    fastest_s: float = ranged(3.0, 0.05, 1e4)
    fastest_periods: float = ranged(1.5, 1.0, 100.0)
    lag_floor_s: float = ranged(1.0, 0.0, 1e4)
    lag_floor_share: float = ranged(0.05, 0.0, 1.0)
    mistaken_k: float = ranged(0.16, 0.001, 1e3)
    calmer: float = ranged(3.0, 1.0, 100.0)
    smoothness: float = ranged(0.4, 0.0, 10.0)
    left_out: float = ranged(0.4, 0.0, 1.0)
    even: float = ranged(2.0, 0.0, 10.0)
    heavy_k: float = ranged(1.2, 0.01, 1e3)
    resting: float = ranged(2.2, 0.0, 10.0)
    rest_power: float = ranged(0.08, 0.0, 1.0)
    vague_share: float = ranged(0.25, 0.0, 10.0)
    vague_k_per_s: float = ranged(0.05, 0.0, 10.0)
    caution: float = ranged(1.0, 0.0, 10.0)
    agreed_k: float = ranged(0.05, 0.0, 10.0)

    def __post_init__(self) -> None:
        check_ranges(self)
