r"""How much heat a plant loses at other temperatures than the one it has now.

A balance of heat over stretches of some ten seconds, with what was applied and what was read:

.. math:: \dot T = \beta q - \ell(T) - g\,(T - T_w), \qquad \ell(T) = d + k\,(T - T_c)

with the gain beta, the loss d at the temperature T_c where the plant is, and its slope k. What a
wall still takes up is no loss, for it ends when the wall is as warm: T_w follows T within
`SOAKS_S`, and g says how much goes there. While a plant warms up for the first time nobody can
tell k from g, and what holds it is known the worse for that; at rest the two part.

A Kalman filter learns all of them together with T, so that the errors of gain and loss keep their
correlation: at full power nobody can tell the two apart, while their difference, which says where
the warming ends, is known well. Mains and draughts wander within minutes; that is counted as noise
of T with the power density of the wandering, and neighbouring stretches are not taken for more
than they are worth.

Beyond the temperatures that were seen a loss bends upwards, because water evaporates: the slope
changes by `BEND` of itself per kelvin, give or take `BEND_SD`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from thermoctl.quantities import Uncertain
from thermoctl.regulator.balance.heat_belief import (
    BETA,
    WARMS_AT_MOST_K,
    D,
    G,
    HeatBelief,
    K,
    Row,
    T,
)

START_SD = (0.1, 0.15, 0.01, 1e-3, 1e-3)
"""Standard deviations at the start: of T in K, beta and d in K/s, k and g in 1/s. They are wide,
but for a plant that begins near its rest."""
SCALED = 0.2
"""Relative standard deviation of the rate at full power below which that rate is the scale of what
follows:"""
LOSS_SHARE, WARMS_K, SOAKS_K = 0.3, 30.0, 80.0
"""loss at the start, how far full power warms the plant, and how much colder a wall takes all of it
(one standard deviation: less loss, farther, colder)."""
SOAKS_S = 400.0
"""Time constant in s of a wall: 6 l of it beside 60 W/K."""
WALL_SHARE = 0.35
"""Share of the learnt slope that is doubted as far as the plant is ahead of its walls, since none
follows in just that time."""
WANDER = 0.25
"""Noise of T in a second, as a share of the gain: mains off by 1 % (2 % of power) for a minute."""
DRIFT_BETA, DRIFT_D, DRIFT_K = 2e-4, 3e-4, 5e-4
"""Noise in a second: of gain and loss as shares of the gain, of k as a share of k."""
VAGUE = 0.3
"""Relative standard deviation above which a gain or slope drifts no further."""
BEND, BEND_SD = 0.01, 0.015
"""Change of the slope per kelvin, as a share of it, and its standard deviation."""

NEARLY_K = 0.1
"""Usual difference in K between the water and what a sensor shows of it."""

R_MIN = 1e-6
"""Least variance in K² of the mean reading of a stretch."""
LAG_SHARE = 2.0
"""Share of the late heat that may come earlier or later than a lag of first order has it."""
GATE = 9.0
GATE_STRETCHES = 6
CHANGED_AFTER, FORGIVEN = 3, 0.25
"""Number of jumps that mean another plant, and not a litre of cold water; every stretch without one
takes FORGIVEN off the count."""


class Stretch(NamedTuple):
    """What happened since the middle of the last stretch.

    Parameters
    ----------
    span_s : float
        Time.
    heat_s : float
        Power that reached the sensor, integrated.
    reading_c : float
        Mean reading; NaN where there was none.
    late_s : float
        Applied power minus that which reached the sensor, integrated without its sign.
    """

    span_s: float
    heat_s: float
    reading_c: float
    late_s: float = 0.0


def start(reading_c: float) -> HeatBelief:
    """Return the belief at the first reading."""
    P = [[sd * sd * (row == place) for place in range(5)] for row, sd in enumerate(START_SD)]
    return HeatBelief((reading_c, 0.0, 0.0, 0.0, 0.0), _rows(P), reading_c, reading_c)


def after(belief: HeatBelief, stretch: Stretch) -> HeatBelief:
    """Return the belief after a stretch; without a reading it is carried on."""
    x, P = _predicted(belief, stretch)
    centre_c, y = x[T], stretch.reading_c
    middle_c = 0.5 * (belief.x[T] + centre_c)
    wall_c = middle_c + (belief.wall_c - middle_c) * math.exp(-stretch.span_s / SOAKS_S)
    if not math.isfinite(y):
        carried = replace(belief, x=x, P=_rows(P), centre_c=centre_c, wall_c=wall_c)
        return replace(carried, before_c=(math.nan, math.nan), jumps=0.0)
    R = _noise(belief, y)
    nu = y - x[T]
    jumps = max(0.0, belief.jumps - FORGIVEN)
    if belief.stretches >= GATE_STRETCHES and nu * nu > GATE * (P[T][T] + R):
        jumps = belief.jumps + 1.0
        if jumps < CHANGED_AFTER:
            P[T][T] += nu * nu
        else:
            P = [P[T], *([row[T], *(4.0 * p for p in row[BETA:])] for row in P[BETA:])]
    x, rows = _met(x, P, T, nu, R)
    known, before_c = belief.stretches + 1, (y, belief.before_c[0])
    learnt = HeatBelief(x, rows, centre_c, wall_c, known, R, before_c, jumps, belief.scaled)
    return learnt if learnt.scaled else _scaled(learnt)


def _met(
    x: Row, P: Sequence[Sequence[float]], place: int, nu: float, R: float
) -> tuple[Row, tuple[Row, ...]]:
    """Return `x` and `P` after the number at `place` was seen `nu` higher, with variance `R`."""
    with_it = P[place]
    S = with_it[place] + R
    met = tuple([mean + p / S * nu for mean, p in zip(x, with_it, strict=True)])
    # Products before quotients: so P stays symmetric to the last bit. Written out for all five, it
    # takes half the time of a loop within the loop.
    a, b, c, d, e = with_it
    return met, tuple(
        [
            (p - g * a / S, q - g * b / S, r - g * c / S, s - g * d / S, t - g * e / S)
            for (p, q, r, s, t), g in zip(P, with_it, strict=True)
        ]
    )


def _scaled(belief: HeatBelief) -> HeatBelief:
    """Return what the rate at full power, once it is known, says of loss and slope.

    Nothing can be known of them before: 50 W in 200 l and 5 kW in 5 l are a factor 4,000 apart.
    """
    rate, sd = spare(belief, belief.x[T], 1.0)
    if sd > SCALED * abs(rate):
        return belief
    x, P = belief.x, belief.P
    scales = (LOSS_SHARE * rate, rate / WARMS_K, rate / SOAKS_K)
    for place, scale in zip((D, K, G), scales, strict=True):
        wide = [list(row) for row in P]
        wide[place][place] += scale * scale  # `START_SD` was only a guess
        x, P = _met(x, wide, place, -x[place], scale * scale)
    return replace(belief, x=x, P=P, scaled=True)


def _predicted(belief: HeatBelief, stretch: Stretch) -> tuple[Row, list[list[float]]]:
    """Return mean and covariance one stretch later, before its reading is looked at.

    Readings are missing for hours where a heater is stuck on. So the mean goes by a slope that no
    plant has that runs away by itself, and by the trapezoidal rule, which keeps any stretch stable.
    """
    span_s, heat_s = stretch.span_s, stretch.heat_s
    T_c, beta, d, k, g = belief.x
    off_k, ahead_k = T_c - belief.centre_c, belief.ahead_k
    steep, soaks = belief.slope, belief.soaks
    begin_k = heat_s * beta - span_s * (d + steep * off_k + soaks * ahead_k)
    half_k = begin_k / (2.0 + span_s * (steep + soaks))
    risen_ks = span_s * (off_k + half_k)
    ahead_ks = span_s * (ahead_k + half_k)
    move_k = off_k + heat_s * beta - span_s * d - risen_ks * steep - ahead_ks * soaks
    bends = 1.0 + max(-0.5, BEND * move_k) if k > 0.0 else 1.0

    def moved(v: Sequence[float]) -> Row:
        """Return F v: T moves with the heat and the loss, d with k, and k bends."""
        T_v, beta_v, d_v, k_v, g_v = v
        T_v += heat_s * beta_v - span_s * d_v - risen_ks * k_v - ahead_ks * g_v
        return T_v, beta_v, d_v + move_k * k_v, bends * k_v, g_v

    columns = [moved(row) for row in belief.P]  # of F P, which is symmetric
    rows = [moved(row) for row in zip(*columns, strict=True)]  # of F P F'
    P = [
        [0.5 * (p + q) for p, q in zip(row, column, strict=True)]
        for row, column in zip(rows, zip(*rows, strict=True), strict=True)
    ]
    size, late_s = abs(beta), LAG_SHARE * stretch.late_s
    P[T][T] += size * size * (WANDER * WANDER * span_s + late_s * late_s)
    if P[BETA][BETA] < (VAGUE * size) ** 2:
        P[BETA][BETA] += (DRIFT_BETA * size) ** 2 * span_s
        P[D][D] += (DRIFT_D * size) ** 2 * span_s
    if P[K][K] < (VAGUE * steep) ** 2:
        P[K][K] += (DRIFT_K * steep) ** 2 * span_s + (BEND_SD * steep * move_k) ** 2
    T_c, _, d, _, _ = moved((T_c, beta, d, steep, soaks))
    return (T_c, beta, d, bends * k, g), P


def _rows(P: Sequence[Sequence[float]]) -> tuple[Row, ...]:
    """Return the rows of `P`, which nobody can write to any more."""
    return tuple(map(tuple, P))


def _noise(belief: HeatBelief, y: float) -> float:
    """Return the variance of a mean reading, from how the last three bend."""
    newer, older = belief.before_c
    bend = y - 2.0 * newer + older
    if not math.isfinite(bend):
        return belief.R
    seen = min(bend * bend / 6.0, 9.0 * belief.R)
    share = max(0.02, 1.0 / (belief.stretches + 5.0))
    return max(R_MIN, belief.R + share * (seen - belief.R))


# -- what follows ----------------------------------------------------------------------------------


def spare(
    belief: HeatBelief, at_c: float, power: float, ahead_k: float = 0.0, *, straight: bool = False
) -> Uncertain:
    """Return how fast `power` would still warm the plant at `at_c`, in K/s.

    Its walls are colder by `ahead_k`: 0 once it has been there for long. With a `straight` loss,
    that is at least as much as with one that bends.
    """
    mean = _spare_mean(belief, at_c, power, ahead_k, straight=straight)
    return Uncertain(mean, _spare_sd(belief, at_c, power, ahead_k, straight=straight))


def _spare_mean(
    belief: HeatBelief, at_c: float, power: float, ahead_k: float = 0.0, *, straight: bool = False
) -> float:
    """Return the mean of `spare`."""
    x, steep = belief.x, belief.slope
    mean = power * x[BETA] - x[D] - steep * (at_c - belief.centre_c) - belief.soaks * ahead_k
    away_k = at_c - x[T]
    return mean if straight or away_k <= 0.0 else mean - BEND * (0.5 * steep * away_k * away_k)


def _spare_sd(
    belief: HeatBelief, at_c: float, power: float, ahead_k: float = 0.0, *, straight: bool = False
) -> float:
    """Return the standard deviation of `spare`."""
    steep, away_k = belief.slope, at_c - belief.x[T]
    bent = 0.0 if straight else 0.5 * steep * away_k * away_k
    variance = _variance(belief, (power, -1.0, belief.centre_c - at_c, -ahead_k))
    taken = WALL_SHARE * steep * (belief.ahead_k - ahead_k)
    return math.sqrt(variance + ((BEND_SD * bent) ** 2 + taken * taken))


def holding(belief: HeatBelief, at_c: float) -> Uncertain:
    """Return the power that holds `at_c`, not limited to what there is."""
    if not belief.gain_known:
        return Uncertain()
    beta = belief.gain
    power = -_spare_mean(belief, at_c, 0.0) / beta
    return Uncertain(power, _spare_sd(belief, at_c, power) / abs(beta))


def reach(belief: HeatBelief, power: float) -> Uncertain:
    """Return the temperature at which `power` keeps the plant for good, in degC.

    Far away the errors are not symmetric, and the standard deviation is that of the farther side.
    """
    if not belief.gain_known:
        return Uncertain()
    now_c, steep = belief.x[T], belief.slope
    rate = _spare_mean(belief, now_c, power)
    rise_k = _bent(rate / steep)
    there_sd = _spare_sd(belief, now_c + rise_k, power)
    steep_sd = math.sqrt(belief.P[K][K])
    flatter = max(steep - steep_sd, abs(belief.gain) / WARMS_AT_MOST_K)
    sd_k = max(
        there_sd / (steep * (1.0 + BEND * max(rise_k, 0.0))),
        abs(_bent(rate / flatter) - rise_k),
    )
    return Uncertain(now_c + rise_k, sd_k)


def _bent(straight_k: float) -> float:
    """Return how far it goes where it would be `straight_k` with a loss that does not bend.

    That is the root x of straight - x - BEND x² / 2.
    """
    if straight_k <= 0.0:
        return straight_k
    return (math.sqrt(1.0 + 2.0 * BEND * straight_k) - 1.0) / BEND


def arrival(
    belief: HeatBelief, from_c: float, to_c: float, power: float, rest: Uncertain
) -> Uncertain:
    """Return when the plant comes to rest at `to_c`, in s from now.

    Parameters
    ----------
    belief : HeatBelief
        What is believed.
    from_c : float
        Where the plant would come to rest with holding power from now on.
    to_c : float
        Where it shall come to rest.
    power : float
        Power until the last moment, holding power from then on.
    rest : Uncertain
        How long the heat that is under way then takes to arrive.
    """
    way_k, ahead_k = to_c - from_c, belief.ahead_k
    begin = spare(belief, from_c, power, ahead_k)
    then_k = _ahead(ahead_k, way_k, begin.mean)
    end = spare(belief, to_c, power, then_k)
    slow = min(begin.mean * way_k, end.mean * way_k)
    if not (belief.gain_known and slow > 0.0):
        return Uncertain()
    falling = math.log(begin.mean / end.mean)
    steep = (begin.mean - end.mean) / way_k  # of the chord, so that the bend counts
    straight = abs(falling) < 1e-6
    time_s = way_k / begin.mean if straight else falling / steep
    by_rate = -way_k / (begin.mean * end.mean)
    by_slope = 0.5 * time_s * time_s if straight else (way_k / end.mean - time_s) / steep
    by_k = by_slope - by_rate * (from_c - belief.centre_c)
    by_g = -by_rate * 0.5 * (ahead_k + then_k)
    variance = _variance(belief, (by_rate * power, -by_rate, by_k, by_g))
    variance += (by_slope * 0.5 * BEND_SD * belief.slope * way_k) ** 2
    wander_s = WANDER * belief.gain / begin.mean * math.sqrt(time_s)
    more_s = math.hypot(wander_s, NEARLY_K / end.mean, rest.sd)
    return Uncertain(time_s + rest.mean, math.hypot(math.sqrt(variance), more_s))


def _ahead(ahead_k: float, way_k: float, rate: float) -> float:
    """Return how far ahead of its walls the plant is after `way_k` at `rate` in K/s."""
    if not way_k * rate > 0.0:
        return ahead_k
    lagging_k = rate * SOAKS_S
    return lagging_k + (ahead_k - lagging_k) * math.exp(-way_k / lagging_k)


def _variance(belief: HeatBelief, by: Row) -> float:
    """Return the variance of a number with these derivatives by all but T."""
    b, d, k, g = by
    _, (_, bb, bd, bk, bg), (_, _, dd, dk, dg), (_, _, _, kk, kg), (*_, gg) = belief.P
    of_b = b * (b * bb + 2.0 * (d * bd + k * bk + g * bg))
    of_d = d * (d * dd + 2.0 * (k * dk + g * dg))
    return max(of_b + of_d + k * (k * kk + 2.0 * g * kg) + g * g * gg, 0.0)
