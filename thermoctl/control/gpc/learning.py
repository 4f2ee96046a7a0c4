r"""How the model is learnt: a Kalman filter on theta with its guards built in.

.. math::

    \theta \leftarrow \theta + K e, \qquad
    P \leftarrow (I - K\varphi^T) P (I - K\varphi^T)^T + K R K^T + Q, \qquad
    K = g \circ P\varphi / (\varphi^T P \varphi + R)

The gate g is 1 for the loss, and for everything else as large as the power is excited: at rest
readings are noise on noise, and would teach a's that oscillate and b's of nothing. In this form,
Joseph's, P stays a covariance for any K.

Implements section 10 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from thermoctl.control.gpc.model import ChangeModel
from thermoctl.quantities import Array, clamp, frozen

POLE_START = 0.3
"""First guess of one pole beside the one at 1; a third would begin at 0."""
POLE_SD, GAIN_SD, LOSS_SD = 0.5, 3.0, 0.1
"""Standard deviations at the start: of each a; of the b's and the loss as shares of the first
gain."""
POLE_DRIFT, GAIN_DRIFT, LOSS_DRIFT = 3e-3, 3e-3, 6e-4
"""Drift in a second: of each a; of the b's and the loss as shares of the gain."""
POLE_MAX_S = 140.0
"""Largest time constant in s of the pole beside the one at 1; slower, the two could not be told
apart."""
GAIN_SHARE_MIN = 5e-4
"""Least gain, as a share of the first guess: 200 l at 50 W, where 8 at 1,500 were guessed. With a
larger one such a vessel would wait for hours; what matters is that it is above 0."""
LOSS_MIN, LOSS_MAX = -0.1, 0.95
"""Bounds of the loss, as shares of the gain: no vessel warms by itself for long, and power can hold
it."""

EXCITED_FROM, EXCITED_SPAN = 0.05, 0.05
"""Distance of a power from its running mean beyond which it teaches something, and by how much more
it teaches everything."""
EXCITATION_BLOCKS = 20.0
"""Time constant of that mean, in blocks."""

NOISE_START_K, NOISE_MIN_K = 0.01, 0.003
"""Standard deviation of an innovation in K: the first guess, and the least."""
NOISE_SAMPLES = 200.0
NOISE_CLIP = 9.0
"""Most that a squared innovation counts, in variances: a jump would deafen the filter."""

GATE = 25.0
"""Squared innovation, in variances, beyond which something else than power moved the water."""
GATE_BLOCKS = 6
"""Number of blocks before the gate closes: until then it is the model that is wrong."""
SILENT_MORE, LISTENS_MORE = 2, 3
"""Blocks beyond the memory of the model in which a jump is not learnt from, and multiples of that
time after it in which everything is learnt from: a changed plant has to be learnt anew."""


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """What is believed of theta; arrays read-only.

    Parameters
    ----------
    theta : ndarray, shape (parameters,)
        The model.
    P : ndarray, shape (parameters, parameters)
        Its covariance.
    noise : float
        Variance of an innovation in K².
    mean_power : float
        Running mean from which excitation is counted.
    excited : float
        How much the last sample could teach of a's and b's, in [0, 1].
    samples : int
        Samples met so far.
    since_jump : int
        Samples since the last jump; large when there was none.
    """

    theta: Array
    P: Array
    noise: float = NOISE_START_K**2
    mean_power: float = 0.0
    excited: float = 0.0
    samples: int = 0
    since_jump: int = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Learner:
    """The law of learning.

    Parameters
    ----------
    model : ChangeModel
        What is learnt.
    gain_k : float
        First guess of what full power does in a block, in K; positive.
    size : int
        Samples in a block; each sample then counts as that share of one.
    block_s : float
        Length of a block.
    """

    model: ChangeModel
    gain_k: float
    size: int
    block_s: float
    _first: Learnt = field(init=False, repr=False)
    _cap: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        model, poles = self.model, self.model.n - 1
        theta, sd = np.zeros(model.parameters), np.empty(model.parameters)
        theta[: min(poles, 1)] = -POLE_START
        theta[model.inputs] = self.gain_k * (1.0 + theta[:poles].sum()) / model.m
        sd[:poles] = POLE_SD
        sd[model.inputs] = GAIN_SD * self.gain_k / model.m
        sd[-1] = LOSS_SD * self.gain_k
        object.__setattr__(self, "_first", Learnt(frozen(theta), frozen(np.diag(sd * sd))))
        object.__setattr__(self, "_cap", frozen(sd * sd))

    @property
    def gain_min_k(self) -> float:
        """Least gain that is believed, in K a block."""
        return GAIN_SHARE_MIN * self.gain_k

    def start(self) -> Learnt:
        """Return the belief before the first sample."""
        return self._first

    def passed(self, belief: Learnt, power: float) -> Learnt:
        """Return the belief after a sample with a gap in its past: nothing is learnt."""
        return self._moved_on(belief, power)

    def update(self, belief: Learnt, change_k: float, phi: Array, power: float) -> Learnt:
        """Return the belief after a change of the temperature.

        Parameters
        ----------
        belief : Learnt
            The one before.
        change_k : float
            Mean of the block that ends now less that of the one before.
        phi : ndarray, shape (parameters,)
            What it regresses on.
        power : float
            Mean power of the block.

        Raises
        ------
        ArithmeticError
            The result would not be finite; `belief` is still good.
        """
        belief = self._moved_on(belief, power)
        theta, P, noise = belief.theta, belief.P, belief.noise
        e = change_k - float(phi @ theta)
        P_phi = P @ phi
        q = float(phi @ P_phi)
        span = self.size * (self.model.memory + SILENT_MORE)
        settled = belief.samples > GATE_BLOCKS * self.size and belief.since_jump >= (
            span * (1 + LISTENS_MORE)
        )
        if settled and e * e > GATE * (q + noise):
            return replace(belief, since_jump=0, excited=0.0)
        if belief.since_jump < span:
            return replace(belief, excited=0.0)
        excited = self._excitation(phi, belief.mean_power)
        R = noise * self.size  # neighbouring samples share all but one of their readings
        K = P_phi / (q + R)
        K[:-1] *= excited
        A = -np.multiply.outer(K, phi)
        A.reshape(-1)[:: len(K) + 1] += 1.0
        learnt = theta + K * e
        P = A @ P @ A.T + np.multiply.outer(R * K, K)
        learnt = self._projected(learnt, P)
        self._drift(P, learnt, excited)
        if not math.isfinite(np.vdot(P, P) + learnt @ learnt):
            raise ArithmeticError(f"expected a finite model after a change of {change_k!r} K")
        return replace(
            belief,
            theta=frozen(learnt),
            P=frozen(P),
            noise=_followed(noise, e, belief.samples),
            excited=excited,
        )

    def _moved_on(self, belief: Learnt, power: float) -> Learnt:
        mean = belief.mean_power
        mean += (power - mean) / (EXCITATION_BLOCKS * self.size)
        since = min(belief.since_jump + 1, 1_000_000)
        return replace(belief, mean_power=mean, samples=belief.samples + 1, since_jump=since)

    def _excitation(self, phi: Array, mean_power: float) -> float:
        """Return in [0, 1] how far the powers are from their mean."""
        farthest = float(np.abs(phi[self.model.inputs] - mean_power).max())
        return clamp((farthest - EXCITED_FROM) / EXCITED_SPAN, 0.0, 1.0)

    def _drift(self, P: Array, theta: Array, excited: float) -> None:
        """Let a new P grow by what may change in a sample, up to what it began with; in place.

        Along directions that are not excited nothing would take the growth back again.
        """
        model, per_sample_s = self.model, self.block_s / self.size
        gain_k = model.gain_k(theta)
        grown = np.empty(model.parameters)
        grown[: model.n - 1] = POLE_DRIFT**2 * excited
        grown[model.inputs] = (GAIN_DRIFT * gain_k) ** 2 * excited / model.m
        grown[-1] = (LOSS_DRIFT * gain_k) ** 2
        grown *= per_sample_s
        P += P.T
        P *= 0.5  # rounding alone would break the symmetry
        diagonal = P.reshape(-1)[:: model.parameters + 1]
        diagonal += grown
        if (diagonal > self._cap).any():
            d = np.sqrt(self._cap / np.maximum(diagonal, self._cap))
            P *= np.multiply.outer(d, d)

    def _projected(self, theta: Array, P: Array) -> Array:
        """Return theta as a heated vessel can have it.

        Poles are those of lags in a row, no b is negative, and the gain has its sign: without it a
        law that divides by the gain would heat what is too hot.
        """
        model, poles = self.model, self.model.n - 1
        slowest = math.exp(-self.block_s / POLE_MAX_S)
        theta = _toward_lags(theta, P, poles, slowest)
        for j in range(poles, poles + model.m):
            if theta[j] < 0.0:  # the rest follows by its correlation
                theta = theta - P[j] * (theta[j] / P[j, j])
        theta = theta.copy()
        b = theta[model.inputs]
        np.maximum(b, 0.0, out=b)
        theta[:poles] = _of_lags(theta[:poles].tolist(), slowest)
        least_k = self.gain_min_k * (1.0 + float(theta[:poles].sum()))
        b += max(least_k - float(b.sum()), 0.0) / model.m
        full_k = float(b.sum())
        theta[-1] = clamp(float(theta[-1]), LOSS_MIN * full_k, LOSS_MAX * full_k)
        return theta


def _followed(noise: float, e: float, samples: int) -> float:
    share = max(1.0 / NOISE_SAMPLES, 1.0 / (samples + 5.0))
    followed = noise + (min(e * e, NOISE_CLIP * noise) - noise) * share
    return max(followed, NOISE_MIN_K**2)


def _toward_lags(theta: Array, P: Array, poles: int, slowest: float) -> Array:
    """Return theta with poles about as `_of_lags`, the rest following by its correlation.

    A pole that is no lag's is moved to where one may be, and the other one stays. A pair is moved
    together by the least that P allows: its sum kept, a vessel of several litres to the kilowatt
    seems a third slower than it is.
    """
    a = theta[:poles].tolist()
    square = a[0] * a[0] - 4.0 * a[1] if poles == 2 else 0.0
    if square < 0.0:
        slope = np.array((2.0 * a[0], -4.0))
        across: Array = P[:, :2] @ slope
        moved: Array = theta - across * (square / float(slope @ across[:2]))
        return moved
    lags = _of_lags(a, slowest)
    if lags is a:
        return theta
    gone = np.linalg.solve(P[:poles, :poles], np.array(lags) - theta[:poles])
    return theta + P[:, :poles] @ gone


def _of_lags(a: list[float], slowest: float) -> list[float]:
    """Return `a` if its one or two poles are those of lags, else the a's of lags nearby.

    Heat only ever spreads: what it passes are lags, whose poles are real and lie in [0, 1). A pole
    below 0 or a pair that swings fits a slow beginning as well as a second lag does, and foretells
    what no vessel does.
    """
    if not a:
        return a
    if len(a) == 1:
        return a if -slowest <= a[0] <= 0.0 else [-clamp(-a[0], 0.0, slowest)]
    square = a[0] * a[0] - 4.0 * a[1]
    root = math.sqrt(max(square, 0.0))
    fast, slow = 0.5 * (-a[0] - root), 0.5 * (-a[0] + root)
    if square >= 0.0 <= fast and slow <= slowest:
        return a
    fast, slow = clamp(fast, 0.0, slowest), clamp(slow, 0.0, slowest)
    return [-(fast + slow), fast * slow]
