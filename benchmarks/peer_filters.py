"""Least squares and Kalman filters of other packages, made to learn from one stream of samples.

A contender takes a `Stream` and returns theta and P after its last sample; everything that differs
from package to package in how a sample is handed over was prepared in the stream, so only the
filter is timed. Each package is imported when its contender is made: one that is not installed
raises ``ImportError`` there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thermoctl.estimation import CorrectedKalman, RandomWalkKalman, RecursiveLeastSquares, start
from thermoctl.ports import Estimator
from thermoctl.quantities import Array

FORGETTING, R1, R2 = 0.98, 1e-4, 1.0

Belief = tuple[Array, Array]
Contender = Callable[["Stream"], Belief]


@dataclass(frozen=True, slots=True)
class Stream:
    """Samples of ``y = phi' theta + v``, in every form a package asks for."""

    phi: list[Array]
    rows: list[Array]
    y: list[float]
    vectors: list[Array]

    @classmethod
    def of(cls, n: int, samples: int) -> Stream:
        """Return samples of n parameters that wander."""
        rng = np.random.default_rng(n)
        theta = rng.normal(size=n) + np.cumsum(1e-2 * rng.normal(size=(samples, n)), axis=0)
        phi = rng.normal(size=(samples, n))
        y = (phi * theta).sum(axis=1) + rng.normal(size=samples)
        return cls(list(phi), list(phi[:, None]), y.tolist(), list(y[:, None]))

    @property
    def n(self) -> int:
        """Number of parameters."""
        return len(self.phi[0])


def thermoctl(law: Estimator) -> Contender:
    """Return a contender that runs a law of this project."""

    def run(stream: Stream) -> Belief:
        belief, update = start(stream.n), law.update
        for phi, y in zip(stream.phi, stream.y, strict=True):
            belief = update(belief, phi, y)
        return belief.theta, belief.P

    return run


def padasip_adapt() -> Contender:
    """Return padasip's least squares, one call a sample."""
    from padasip.filters import FilterRLS

    def run(stream: Stream) -> Belief:
        rls = FilterRLS(stream.n, mu=FORGETTING, eps=1.0, w="zeros")
        for phi, y in zip(stream.phi, stream.y, strict=True):
            rls.adapt(y, phi)
        return rls.w, rls.R

    return run


def padasip_run() -> Contender:
    """Return padasip's least squares, its own loop over all samples."""
    from padasip.filters import FilterRLS

    def run(stream: Stream) -> Belief:
        rls = FilterRLS(stream.n, mu=FORGETTING, eps=1.0, w="zeros")
        rls.run(stream.y, stream.phi)
        return rls.w, rls.R

    return run


def filterpy(corrected: bool = False) -> Callable[[], Contender]:
    """Return what makes filterpy's filter, with the correction O21 (26) after it if wanted."""

    def make() -> Contender:
        from filterpy.kalman import KalmanFilter

        def run(stream: Stream) -> Belief:
            n = stream.n
            kf = KalmanFilter(dim_x=n, dim_z=1)
            kf.Q, kf.R = R1 * np.eye(n), R2 * np.eye(1)
            for row, y in zip(stream.rows, stream.y, strict=True):
                kf.update(y, H=row)
                if corrected:
                    e, S = kf.y.item(), kf.S.item()
                    kf.P = kf.P * max(1.0, e * e / (S * (n + 1)))  # O21 (26)
                kf.predict()
            return kf.x[:, 0], kf.P

        return run

    return make


def pykalman() -> Contender:
    """Return pykalman's filter."""
    from pykalman import KalmanFilter

    def run(stream: Stream) -> Belief:
        drift = R1 * np.eye(stream.n)
        kf = KalmanFilter(np.eye(stream.n), stream.rows[0], drift, R2 * np.eye(1))
        theta, P = np.zeros(stream.n), np.eye(stream.n) - drift  # it predicts before it updates
        for row, y in zip(stream.rows, stream.y, strict=True):
            theta, P = kf.filter_update(theta, P, y, observation_matrix=row)
        return np.asarray(theta), P + drift

    return run


def kalman_py() -> Contender:
    """Return kalman-py's filter."""
    from kalman_py import KalmanFilter

    def run(stream: Stream) -> Belief:
        F, rows = np.eye(stream.n), stream.rows
        kf = KalmanFilter(F, rows[0], R1 * F, R2 * np.eye(1), np.zeros(stream.n), F)
        for row, y in zip(rows, stream.vectors, strict=True):
            kf.update(y, H=row)
            kf.predict()
        return kf.x, kf.P

    return run


def kalbee() -> Contender:
    """Return kalbee's filter."""
    from kalbee import KalmanFilter

    def run(stream: Stream) -> Belief:
        F, rows = np.eye(stream.n), stream.rows
        kf = KalmanFilter(np.zeros((stream.n, 1)), F, F, R1 * F, rows[0], R2 * np.eye(1))
        for row, y in zip(rows, stream.vectors, strict=True):
            kf.measurement_matrix = row
            kf.update(y)
            kf.predict()
        return kf.state[:, 0], kf.covariance

    return run


def kalmankit() -> Contender:
    """Return kalmankit's filter."""
    from kalmankit import KalmanFilter

    def run(stream: Stream) -> Belief:
        F, rows, none = np.eye(stream.n), stream.rows, np.array(np.nan)
        Q, R, theta, P = R1 * F, R2 * np.eye(1), np.zeros(stream.n), F
        kf = KalmanFilter(F[None], theta, None, P, rows[0][None], Q[None], R[None])
        for row, y in zip(rows, stream.vectors, strict=True):
            theta, P = kf.update(row, theta, P, y, R)
            theta, P = kf.predict(F, theta, none, none, P, Q)
        return theta, P

    return run


def minkf() -> Contender:
    """Return minkf's filter."""
    from minkf import kf_predict, kf_update

    def run(stream: Stream) -> Belief:
        F = np.eye(stream.n)
        Q, R, theta, P = R1 * F, R2 * np.eye(1), np.zeros(stream.n), F
        for row, y in zip(stream.rows, stream.vectors, strict=True):
            theta, P = kf_update(y, theta, P, row, R)
            theta, P = kf_predict(theta, P, F, Q)
        return theta, P

    return run


def simdkalman() -> Contender:
    """Return simdkalman's steps, on one series."""
    from simdkalman.primitives import predict, update

    def run(stream: Stream) -> Belief:
        F = np.eye(stream.n)
        Q, R, theta, P = R1 * F, R2 * np.eye(1), np.zeros((stream.n, 1)), F
        for row, y in zip(stream.rows, stream.vectors, strict=True):
            theta, P = update(theta, P, row, R, y[:, None])
            theta, P = predict(theta, P, F, Q)
        return theta[:, 0], P

    return run


def fast_kalman() -> Contender:
    """Return fast-kalman's filter, which is compiled."""
    from kalman import LinearKalmanFilter

    def run(stream: Stream) -> Belief:
        n, F = stream.n, np.eye(stream.n).ravel()
        drift, one = (R1 * F).tolist(), F.tolist()
        kf = LinearKalmanFilter(n, 1, [0.0] * n, one, one, drift, [0.0] * n, [R2])
        for phi, y in zip([phi.tolist() for phi in stream.phi], stream.y, strict=True):
            kf.H = phi
            kf.correct([y])
            kf.predict()
        return np.array(kf.x), np.array(kf.P).reshape(n, n)

    return run


OURS = {
    "recursive least squares": thermoctl(RecursiveLeastSquares(FORGETTING)),
    "Kalman filter": thermoctl(RandomWalkKalman(R1, R2)),
    "corrected Kalman filter": thermoctl(CorrectedKalman(R1, R2)),
}
PEERS: dict[str, dict[str, Callable[[], Contender]]] = {
    "recursive least squares": {"padasip, adapt": padasip_adapt, "padasip, run": padasip_run},
    "Kalman filter": {
        "filterpy": filterpy(),
        "minkf": minkf,
        "kalmankit": kalmankit,
        "kalman-py": kalman_py,
        "simdkalman": simdkalman,
        "kalbee": kalbee,
        "pykalman": pykalman,
        "fast-kalman": fast_kalman,
    },
    "corrected Kalman filter": {"filterpy and (26)": filterpy(corrected=True)},
}
COMPILED = {"fast-kalman"}
"""Peers that are no pure Python over NumPy."""
