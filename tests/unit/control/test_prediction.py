"""Prediction over the delay: iterating the model, and dividing polynomials, are one."""

import numpy as np
import pytest

from thermoctl.control.prediction import foresee, predict
from thermoctl.model.arx import Arx


def division(theta, n, d):
    """Return F and G of ``1 = A F + q^-d G``, F with d coefficients, by long division."""
    A = np.concatenate(([1.0], theta[:n]))
    rest, F = np.concatenate(([1.0], np.zeros(n + d))), np.zeros(d)
    for i in range(d):
        F[i] = rest[i]
        rest[i : i + n + 1] -= F[i] * A
    assert np.allclose(rest[:d], 0.0)
    return F, rest[d : d + n]


@pytest.mark.parametrize("d", [1, 2, 3, 7])
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (3, 3), (1, 4), (0, 2)])
def test_iterating_the_model_is_the_same_as_dividing_its_polynomials(n, m, d):
    rng = np.random.default_rng((n, m, d))
    structure, theta = Arx(n, m, d), rng.normal(size=n + m)
    y, u = rng.normal(size=max(n, 1)), rng.normal(size=d + m - 2)
    now = float(rng.normal())
    F, G = division(theta, n, d)
    FB = np.convolve(F, theta[n:])  # y(t+d|t) = G y(t) + F B u(t)
    expected = G @ y[:n] + FB @ np.concatenate(((now,), u))
    y_ahead, u_ahead = foresee(structure, theta, y, u, d - 1)
    free = predict(structure, theta, y_ahead, np.concatenate(((0.0,), u_ahead)))
    assert free + theta[n] * now == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_what_is_foreseen_is_what_then_happens_while_the_model_is_the_plant():
    structure, theta = Arx(2, 2, 4, 20.0, 8.0, 0.5), np.array([-1.5, 0.55, 0.02, 0.01])
    rng = np.random.default_rng(1)
    y, u = 20.0 + 8.0 * rng.normal(size=2), rng.uniform(size=4)
    foreseen, _ = foresee(structure, theta, y, u, 3)
    for power in rng.uniform(size=3):  # whatever is given from now on
        u = np.concatenate(((power,), u))
        y = np.concatenate(((predict(structure, theta, y, u),), y))
    assert foreseen == pytest.approx(y, rel=1e-14)


@pytest.mark.parametrize("samples", [-1, 3, 4])
def test_no_further_than_the_delay_is_decided(samples):
    with pytest.raises(ValueError, match="samples must be from 0 to 2"):
        foresee(Arx(1, 1, 3), np.zeros(2), np.zeros(1), np.zeros(2), samples)
