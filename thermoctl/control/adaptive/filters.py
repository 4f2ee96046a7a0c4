r"""A Kalman filter for every hypothesis, all in one array.

The state is :math:`x = (T, z, d, \beta)`: water and sensor in degC, loss and gain in K per period,
without power and from full power. A block holds ``[P | x]``, shape (4, 5, n), so that what is done
to the rows of P is done to x in the same breath. Where gains are kept P stays as it is, and the
states x go on in an array of their own, shape (4, n): `moved` and `followed`. What changes the
block it is given says so, all other functions return a new one.

P is symmetric to the last bit, since each pair of elements is made by the same operations on equal
numbers; no second pass is needed (``test_covariances_stay_symmetric_to_the_last_bit``).

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from thermoctl.control.adaptive.constants import Plants
from thermoctl.control.adaptive.hypotheses import Hypotheses
from thermoctl.quantities import Array, frozen

Block = Array
T, Z, D, BETA = range(4)
X = 4
"""Column of the state in a block; columns 0 to 3 are P."""

START_GAIN = 0.002
"""First guess of the gain in K/s; with `START_SD` it hardly matters."""
START_SD = (1.0, 1.0, 0.001, 0.15)
"""Of T and z in K, d and beta in K/s. Tight on the loss, wide on the gain: a warm-up at full power
cannot tell the two apart, and a loss that was learnt there in place of a gain is held for real."""
START_CORRELATION = 0.98
"""Of T and z: a sensor shows the water it lies in."""

GAIN_LEAST = 1e-4
"""Least gain in K/s of which noises are shares."""

LOSS_MIN, LOSS_MAX = 0.5, 0.95
"""Bounds of the loss, in gains: LOSS_MIN below the least power, and LOSS_MAX of full power."""

CAUGHT_UP = 0.03
"""Largest share by which a sample at rest is taken to change the variance of the loss."""


class Prior(NamedTuple):
    """What is believed of gain and loss before the first reading; all in K/s.

    Parameters
    ----------
    gain, gain_sd : float
        Heating rate at full power.
    loss, loss_sd : float
        Cooling without power.
    losing : float
        1 where it has long been so, as in a plant that was held; 0 in one that is met cold.
    """

    gain: float = START_GAIN
    gain_sd: float = START_SD[BETA]
    loss: float = 0.0
    loss_sd: float = START_SD[D]
    losing: float = 0.0


UNKNOWN = Prior()
"""A plant never seen before."""


class PerPeriod(NamedTuple):
    """What is the same at every sample, as `per_period` makes it; in K and periods.

    Nearly all are arrays of the shape of what they meet. To stretch a number or a row would take
    longer than the operation itself, as few as the hypotheses are.

    Parameters
    ----------
    step, soon : ndarray, shape (5, n)
        `sensor_step` and `sensor_soon` of the hypotheses, for a row of a block.
    noise_water, noise_gain : ndarray, shape (n,)
        Variances of T and beta that a period adds, over the square of the gain.
    noise_loss : float
        That of d at rest.
    unrest, known_share, room_k : float
        As in `Plants`; the last endless where power cools too, and water may be colder than a room.
    noise_sensor : ndarray, shape (n,)
        Variance of z that it adds.
    gain_noisy : ndarray, shape (n,)
        Least gain of which the noise is taken.
    gain_min, gain_max, loss_min, loss_max : ndarray, shape (n,)
        Limits of the gain, and those of the loss in gains.
    per_room_k, no_loss : ndarray, shape (n,)
        One over `Plants.room_k`, and 0.
    power_min, power_max : ndarray, shape (n,)
        Least and most power.
    """

    step: Array
    soon: Array
    noise_water: Array
    noise_gain: Array
    noise_loss: float
    unrest: float
    known_share: float
    room_k: float
    noise_sensor: Array
    gain_noisy: Array
    gain_min: Array
    gain_max: Array
    loss_min: Array
    loss_max: Array
    per_room_k: Array
    no_loss: Array
    power_min: Array
    power_max: Array


def per_period(hypotheses: Hypotheses, plants: Plants, u_min: float, u_max: float) -> PerPeriod:
    """Return the constants for the period of `hypotheses` and the bounds of power.

    Noise is diag((.08 b)^2, .003^2, (.0008 b)^2, (2e-4 b)^2) times the period h, unless `plants`
    says otherwise. The gain of a period, and the unit of d and beta, are h times those of a second.
    """
    h, one = hypotheses.period_s, np.ones(len(hypotheses))
    return PerPeriod(
        step=np.tile(hypotheses.sensor_step, (5, 1)),
        soon=np.tile(hypotheses.sensor_soon, (5, 1)),
        noise_water=plants.water_drift**2 / h * one,
        noise_gain=plants.gain_drift**2 * h * one,
        noise_loss=plants.loss_drift**2 * h,
        unrest=plants.unrest,
        known_share=plants.known_share,
        room_k=plants.room_k if u_min == 0.0 else np.inf,
        per_room_k=one / plants.room_k,
        no_loss=0.0 * one,
        noise_sensor=plants.sensor_drift_k**2 * h * one,
        gain_noisy=GAIN_LEAST * h * one,
        gain_min=plants.gain_min_k_per_s * h * one,
        gain_max=h * np.maximum(plants.heat_max_k / hypotheses.lag_s, plants.gain_min_k_per_s),
        loss_min=(u_min - LOSS_MIN) * one,
        loss_max=LOSS_MAX * one,
        power_min=u_min * one,
        power_max=u_max * one,
    )


def start(
    hypotheses: Hypotheses, y_c: float, prior: Prior = UNKNOWN, heat: Array | None = None
) -> Block:
    """Return the block at the first reading of a plant, at rest or long under `heat`.

    Under heat the sensor is behind the water by what beta does in its lag, less what d does.
    """
    h, block = hypotheses.period_s, np.zeros((4, 5, len(hypotheses)))
    sd = np.array([*START_SD[:D], prior.loss_sd * h, prior.gain_sd * h])
    P = np.diag(sd**2)
    P[T, Z] = P[Z, T] = START_CORRELATION * sd[T] * sd[Z]
    block[:, :X] = P[:, :, None]
    block[:, X] = np.array([y_c, y_c, prior.loss * h, prior.gain * h])[:, None]
    if heat is not None:
        behind, above = hypotheses.sensor * heat, hypotheses.sensor * prior.losing
        block[T] += behind * block[BETA] - above * block[D]
        block[:, T] += behind * block[:, BETA] - above * block[:, D]
    return block


def restarted(block: Block, hypotheses: Hypotheses, y_c: float) -> Block:
    """Return `block` with water and sensor as at the start, and the rest as it is."""
    after = start(hypotheses, y_c)
    after[D:, D:] = block[D:, D:]
    return after


def predicted(
    block: Block, heat: Array, constants: PerPeriod, unrest: float = 0.0, above_k: float = 0.0
) -> Block:
    """Return the block one period later.

    T' = T - d + beta q and z' = z + a (T - z) + c (T' - T), exact for water that warms evenly
    within a period; `heat` is q in the mean of it. Where a period is as long as the lag, a sensor
    that knew of T alone would show nothing before the next one, and no hypothesis would fit.
    `unrest` is how far the power was from what holds the water, `above_k` as for `grown`.
    """
    after, a, c = block.copy(), constants.step, constants.soon
    water, sensor = after[T], after[Z]
    warming = _carried(water, sensor, block[D], block[BETA], heat, a, c)  # F [P | x]
    grown(after[D, X], warming[X], constants, above_k)
    TT, ZT, ZZ = water[T], sensor[T], sensor[Z]
    towards = ZT - ZZ
    towards *= a[Z]
    warming = water[BETA] * heat
    warming -= water[D]
    TT += warming  # F P F', where row and column move
    warming = sensor[BETA] * heat
    warming -= sensor[D]
    ZT += warming
    ZZ += towards
    warming *= c[Z]
    ZZ += warming
    after[T, Z] = ZT  # and by symmetry elsewhere
    after[D:, :D] = after[:D, D:X].swapaxes(0, 1)
    if above_k > constants.room_k:
        _widened(after, block[D, X])
    DD, BB = after[D, D], after[BETA, BETA]
    b2 = np.maximum(block[BETA, X], constants.gain_noisy)
    b2 *= b2
    TT += constants.noise_water * b2
    ZZ += constants.noise_sensor
    DD += constants.noise_loss * (1.0 + constants.unrest * unrest) ** 2 * b2
    BB += constants.noise_gain * b2
    return after


def moved(
    x: Array, heat: Array, hypotheses: Hypotheses, constants: PerPeriod, above_k: float = 0.0
) -> Array:
    """Return the states, shape (4, n), one period later as `predicted` does."""
    after, a, c = x.copy(), hypotheses.sensor_step, hypotheses.sensor_soon
    d = after[D]
    warming = _carried(after[T], after[Z], d, after[BETA], heat, a, c)
    grown(d, warming, constants, above_k)
    return after


def _carried(
    water: Array, sensor: Array, d: Array, beta: Array, heat: Array, a: Array, c: Array
) -> Array:
    """Carry rows of water and sensor over a period, in place; return by what the water moved."""
    towards = water - sensor
    towards *= a
    warming = beta * heat
    warming -= d
    water += warming
    sensor += towards
    sensor += warming * c
    return warming


def grown(loss: Array, moved_k: Array, constants: PerPeriod, above_k: float) -> None:
    """Let the `loss` d go with water that has moved by `moved_k`, in place.

    As d' = d + max(d, 0) tanh(moved / r), which keeps its sign and cannot run away, however long a
    period is; r is 40 K, or `above_k` where its surroundings are known to be farther away than
    that. Water that gains heat from them is left alone: only who heats and cools has it.
    """
    hot = above_k > constants.room_k
    grows = np.tanh(moved_k / above_k if hot else moved_k * constants.per_room_k)
    grows *= np.maximum(loss, constants.no_loss)
    loss += grows


def _widened(block: Block, before: Array) -> None:
    """Let what is not known of a loss go as the loss has from `before`, in place.

    So has its error. As long as r is `Plants.room_k` that is little beside the noise of d.
    """
    share = np.divide(block[D, X], before, out=np.ones_like(before), where=before > 0.0)
    block[D, :X] *= share
    block[:, D] *= share


def arrivals(hypotheses: Hypotheses, plants: Plants) -> Mapping[int, Array]:
    """Return, by sample, how much is loosened where the heat has just arrived."""
    samples = np.floor(plants.loosened_lags * (hypotheses.lag_s / hypotheses.period_s)) + 1.0
    return {int(each): plants.loosened_share * (samples == each) for each in np.unique(samples)}


def loosened(block: Block, heat: Array, spread: Array) -> None:
    """Make gain and loss uncertain together, by the share `spread`; in place.

    Under constant heat only their difference shows. The start is tight on the loss, so that it does
    not take the place of a gain; now both may grow or shrink by as much, and what was learnt of the
    difference is kept. When the heat falls, the loss is found within seconds.
    """
    spread = spread * heat * block[BETA, X]
    block[D:, D:X] += spread * spread


def reopened(block: Block, plants: Plants) -> Block:
    """Return the block with an uncertain loss: the water drifts, so it has changed.

    By something like a share of the gain, if the surroundings did it. If there is less water than
    there was, loss and gain have both grown by one factor. The power that holds the water is the
    same then, so nothing shows of the gain before the next move.
    """
    after = block.copy()
    spread = plants.reopened_share * block[BETA, X]
    after[D, D] += spread * spread
    both = plants.rescaled_share * block[D:, X]
    after[D:, D:X] += both[:, None] * both
    return after


def inflated(block: Block, nu: float, R: float) -> Block:
    r"""Return the block after the water has jumped; O21 (25)-(26) on T and z alone.

    :math:`\lambda^* = \max(1, \nu^2/S)` with the innovation `nu` of the likeliest hypothesis.
    On all states, loss and gain would run away.
    """
    after = block.copy()
    root = np.sqrt(np.maximum(nu * nu / (block[Z, Z] + R), 1.0))  # O21 (26)
    after[: Z + 1, :X] *= root
    after[:, : Z + 1] *= root
    return after


def corrected(
    block: Block, y_c: float, R: float, constants: PerPeriod, proof: float = 1.0
) -> tuple[Block, Array, Array]:
    """Return the block after reading `y_c`, the innovations squared over S, and S.

    S are the variances of the innovations. Where the gain beta is known, it is corrected by the
    share `proof` of what Kalman would: at 0 it is *considered*, as Schmidt does, and not estimated.
    Its uncertainty counts in all else, and what binds it to the rest is kept. In a closed loop at
    rest power follows the noise of the reading, and a gain that is estimated there climbs for
    hours, surer at every step.
    """
    g = block[Z].copy()
    nu = g[X]
    nu -= y_c
    S = g[Z] + R
    g /= np.sqrt(S)  # P H' / sqrt S, and beside it -nu / sqrt S
    after = g[:X, None] * g
    if proof < 1.0:  # of beta K = p g / sqrt S: Joseph's form differs from P - g g' here alone
        known, P, x = gain_known(block, constants), after[BETA, BETA], after[BETA, X]
        np.multiply(P, proof * (2.0 - proof), out=P, where=known)
        np.multiply(x, proof, out=x, where=known)
    np.subtract(block, after, out=after)  # P - g g', x + g nu / sqrt S
    return after, nu * nu, S


def followed(x: Array, y_c: float, K: Array, constants: PerPeriod) -> Array:
    """Return the states after reading `y_c`, corrected by the gains `K`.

    All are of shape (4, n). Of all limits only the one below which a gain is none is kept: the next
    full sample has others.
    """
    after: Array = K * (y_c - x[Z])
    after += x
    beta = after[BETA]
    np.maximum(beta, constants.gain_min, out=beta)
    return after


def joined(block: Block, x: Array) -> Block:
    """Return `block` with the states `x`, shape (4, n); itself, if they lie in it."""
    if x.base is block:
        return block
    after = block.copy()
    after[:, X] = x
    return frozen(after)


def gains_at_rest(block: Block, S: Array, known: npt.NDArray[np.bool_]) -> Array:
    """Return the gains K of the states, shape (4, n), those of `corrected` at rest."""
    K: Array = block[Z, :X] / S
    K[BETA, known] = 0.0
    return K


def gain_known(block: Block, constants: PerPeriod) -> npt.NDArray[np.bool_]:
    """Return of which hypotheses the gain beta is known, shape (n,)."""
    most = constants.known_share * block[BETA, X]
    most *= most
    known: npt.NDArray[np.bool_] = block[BETA, BETA] <= most
    return known


def caught_up(block: Block, before: Block, samples: int) -> Array:
    """Let P go on for `samples` more as it has from `before` to `block`; in place.

    At rest the loss is still becoming better known or worse, by some share in every sample. Scaled
    by the square root of that share in row and column P stays positive and its correlations what
    they are. And gains are slowly forgotten, by as much in every sample. Returned is by what the
    gain K of the loss is larger for it, shape (n,).
    """
    block[BETA, BETA] += samples * np.maximum(block[BETA, BETA] - before[BETA, BETA], 0.0)
    share = np.minimum(np.maximum(block[D, D] / before[D, D], 1.0 - CAUGHT_UP), 1.0 + CAUGHT_UP)
    scale: Array = share ** (0.5 * samples)
    block[D, :X] *= scale
    block[:, D] *= scale
    return scale


def limit_gain(block: Block, constants: PerPeriod) -> None:
    """Limit the gain of a new block to what a plant can have, in place."""
    beta = block[BETA, X]
    np.maximum(beta, constants.gain_min, out=beta)
    np.minimum(beta, constants.gain_max, out=beta)


def limit_loss(block: Block, constants: PerPeriod) -> None:
    """Limit the loss of a new block to what a plant of its gain can have, in place."""
    d, beta = block[D, X], block[BETA, X]
    np.maximum(d, constants.loss_min * beta, out=d)
    np.minimum(d, constants.loss_max * beta, out=d)
