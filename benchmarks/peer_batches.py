"""Many replications of one filter at once: ours, a loop in C, and what other packages offer.

A contender is made for outputs of shape (T, R) and regressors of shape (T, R, n), and returns theta
and P after every sample, with as many replications as it ran. What it needs is looked for when it
is made: ``ImportError`` where it is not there.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from thermoctl.estimation import CorrectedKalman, RandomWalkKalman, run_batch
from thermoctl.quantities import Array

SOURCE = Path(__file__).with_name("c") / "ckf.c"
LOOPED = 5
"""Replications that are looped with filterpy; its time is scaled to all of them."""

Work = Callable[[], tuple[Array, Array]]


def ours(law: CorrectedKalman | RandomWalkKalman) -> Callable[[Array, Array], Work]:
    """Return what makes `run_batch` of `law`."""

    def make(y: Array, phi: Array) -> Work:
        def work() -> tuple[Array, Array]:
            run = run_batch(law, y, phi)
            return run.theta, run.P

        return work

    return make


def c_loop(y: Array, phi: Array) -> Work:
    """Return the corrected filter in C, compiled for the number of parameters of `phi`."""
    compiler = shutil.which("gcc")
    if compiler is None:
        raise ImportError("no gcc on this machine")
    T, R, n = phi.shape
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "ckf.so"
        flags = ["-O2", "-shared", "-fPIC", f"-DN={n}"]
        subprocess.run([compiler, *flags, str(SOURCE), "-o", str(library)], check=True)
        ckf = ctypes.CDLL(str(library)).ckf
    array = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    ckf.argtypes = [ctypes.c_size_t, ctypes.c_size_t, ctypes.c_double, *[array] * 6]
    ckf.restype = None

    def work() -> tuple[Array, Array]:
        theta, P = np.empty((T, R, n)), np.empty((T, R, n, n))
        ckf(T, R, 1.0, y, phi, theta, P, np.empty((T, R)), np.empty((T, R)))
        return theta, P

    return work


def filterpy_loop(y: Array, phi: Array) -> Work:
    """Return filterpy with (26) over the first replications, one after the other."""
    from filterpy.kalman import KalmanFilter

    T, n = len(phi), phi.shape[2]
    rows, outputs = [list(phi[:, r, None]) for r in range(LOOPED)], y.T.tolist()

    def work() -> tuple[Array, Array]:
        theta, P = np.empty((T, LOOPED, n)), np.empty((T, LOOPED, n, n))
        for r in range(LOOPED):
            kf = KalmanFilter(dim_x=n, dim_z=1)
            kf.Q = np.zeros((n, n))
            for t, (row, output) in enumerate(zip(rows[r], outputs[r], strict=True)):
                kf.predict()
                kf.update(output, H=row)
                e, S = kf.y.item(), kf.S.item()
                kf.P = kf.P * max(1.0, e * e / (S * (n + 1)))  # O21 (26)
                theta[t, r], P[t, r] = kf.x[:, 0], kf.P
        return theta, P

    return work


def simdkalman_batch(y: Array, phi: Array) -> Work:
    """Return simdkalman's steps, without (26), over all replications at once."""
    from simdkalman.primitives import predict, update

    T, R, n = phi.shape
    F, drift, noise = np.eye(n), np.zeros((n, n)), np.ones((1, 1))

    def work() -> tuple[Array, Array]:
        x, C = np.zeros((R, n, 1)), np.repeat(F[None], R, axis=0)
        theta, P = np.empty((T, R, n)), np.empty((T, R, n, n))
        for t in range(T):
            x, C = predict(x, C, F, drift)
            x, C = update(x, C, phi[t, :, None], noise, y[t, :, None, None])
            theta[t], P[t] = x[:, :, 0], C
        return theta, P

    return work


OURS = {
    "batch, corrected Kalman filter": ours(CorrectedKalman(0.0, 1.0)),
    "batch, Kalman filter": ours(RandomWalkKalman(0.0, 1.0)),
}
PEERS: dict[str, dict[str, Callable[[Array, Array], Work]]] = {
    "batch, corrected Kalman filter": {"C loop": c_loop, "filterpy and (26)": filterpy_loop},
    "batch, Kalman filter": {"simdkalman": simdkalman_batch},
}
