"""Stationary filters and regulators against closed forms."""

import numpy as np
import pytest

from thermoctl.studies.compare.riccati import Linear, lyapunov, regulated, riccati


@pytest.mark.parametrize("a", [0.3, 0.99, 1.0, 1.7])
@pytest.mark.parametrize("q", [1e-4, 1.0])
def test_a_scalar_equation_has_the_root_of_its_quadratic(a, q):
    b, r = 0.7, 0.2
    # x = a²x - (abx)²/(r + b²x) + q  <=>  b²x² + (r(1 - a²) - b²q) x - qr = 0
    middle = r * (1.0 - a**2) - b**2 * q
    root = (-middle + np.sqrt(middle**2 + 4.0 * b**2 * q * r)) / (2.0 * b**2)
    X = riccati(*(np.array([[value]]) for value in (a, b, q, r)))
    assert X.item() == pytest.approx(root, rel=1e-9)


def random_plant(seed, n=6):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A *= 1.05 / np.abs(np.linalg.eigvals(A)).max()  # not stable by itself
    B, half = rng.normal(size=(n, 1)), rng.normal(size=(n, n))
    return A, B, half @ half.T


@pytest.mark.parametrize("seed", range(5))
def test_the_solution_satisfies_the_equation_and_stabilises_the_plant(seed):
    A, B, Q = random_plant(seed)
    R = np.array([[0.5]])
    X = riccati(A, B, Q, R)
    L = np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A)
    assert pytest.approx(X, rel=1e-7) == A.T @ X @ (A - B @ L) + Q
    assert np.abs(np.linalg.eigvals(A - B @ L)).max() < 1.0


def test_a_covariance_reproduces_itself():
    A, _, Q = random_plant(1)
    A = 0.9 * A
    X = lyapunov(A, Q)
    assert pytest.approx(X, rel=1e-9) == A @ X @ A.T + Q


def test_what_grows_and_is_not_reached_has_no_stationary_solution():
    A, B = np.diag([1.1, 0.5]), np.array([[0.0], [1.0]])
    with pytest.raises(ValueError, match="stabilised"):
        riccati(A, B, np.eye(2), np.eye(1))
    with pytest.raises(ValueError, match="stable"):
        lyapunov(A, np.eye(2))


def integrator(q=0.04, r=1.0):
    one = np.eye(1)
    return Linear(A=one, B=one, Q=np.array([[q]]), C=one, R=r, z=one)


def test_minimum_variance_of_an_integrator_is_that_of_its_prediction():
    q, r = 0.04, 1.0
    predicted = (q + np.sqrt(q**2 + 4.0 * q * r)) / 2.0
    spread = regulated(integrator(q, r), price=1e-12)
    assert spread.judged**2 == pytest.approx(predicted, rel=1e-6)


def test_a_dearer_input_moves_less_and_the_plant_strays_more():
    spreads = [regulated(integrator(), price) for price in (1e-6, 1e-2, 1.0, 100.0)]
    assert sorted(spreads, key=lambda s: s.judged) == spreads
    assert sorted(spreads, key=lambda s: -s.input) == spreads


def test_the_spread_is_that_of_a_simulated_loop():
    plant, rng = integrator(), np.random.default_rng(3)
    price, q = 0.5, 0.04
    expected = regulated(plant, price)
    P = riccati(plant.A.T, plant.C.T, plant.Q, np.array([[plant.R]])).item()
    X = riccati(plant.A, plant.B, np.eye(1), np.array([[price]])).item()
    K, L = P / (P + plant.R), X / (X + price)
    x = believed = 0.0
    judged, inputs = [], []
    for w, v in zip(rng.normal(0, np.sqrt(q), 40_000), rng.normal(0, 1, 40_000), strict=True):
        believed += K * (x + v - believed)
        u = -L * believed
        judged.append(x)
        inputs.append(u)
        x, believed = x + u + w, believed + u
    assert np.std(judged) == pytest.approx(expected.judged, rel=0.03)
    assert np.std(inputs) == pytest.approx(expected.input, rel=0.03)
