"""Figures that ``docs/theory.md`` gives of the recursive laws, and where they become dangerous."""

import math

import numpy as np
import pytest

from thermoctl.estimation import (
    CorrectedKalman,
    Guarded,
    Identifier,
    RandomWalkKalman,
    RecursiveLeastSquares,
    VariableForgetting,
    run_batch,
    start,
)
from thermoctl.model.arx import Arx


@pytest.mark.parametrize(("n", "samples"), [(1, 8.6), (2, 21.0), (3, 47.0), (4, 99.2)])
def test_without_excitation_the_corrected_covariance_doubles_with_a_perfect_model(n, samples):
    rng, T, R = np.random.default_rng(1), 500, 400
    phi = np.zeros((T, R, n))
    phi[:, :, : n - 1] = rng.normal(size=(T, R, n - 1))  # all move but the last
    P = run_batch(CorrectedKalman(), rng.normal(size=(T, R)), phi).P[:, :, -1, -1]
    doublings = np.log2(P[-1] / P[199]).mean()
    assert 300.0 / doublings == pytest.approx(samples, rel=0.08)


def samples_sound_at_rest(law, n, seed, limit):
    """Return after how many samples of one regressor P is positive definite no more."""
    rng, belief, phi = np.random.default_rng(seed), start(n), np.array([1.0, 0.25, -0.5, 0.3][:n])
    for t in range(limit):
        belief = law.update(belief, phi, 1.0 + rng.normal())
        if t % 5 == 0 and not np.linalg.eigvalsh(belief.P)[0] > 0.0:
            return t
    return math.inf


@pytest.mark.parametrize(
    ("law", "n", "samples"),
    [
        (RecursiveLeastSquares(0.95), 2, 745),
        (VariableForgetting(10.0), 2, 330),
        (CorrectedKalman(), 2, 1300),
        (CorrectedKalman(), 3, 2570),
        (CorrectedKalman(inflation_max=2.0), 2, 1370),
    ],
    ids=repr,
)
def test_at_rest_a_law_without_a_cap_comes_to_the_end_of_its_arithmetic(law, n, samples):
    lasted = [samples_sound_at_rest(law, n, seed, 2 * samples) for seed in range(3)]
    assert np.median(lasted) == pytest.approx(samples, rel=0.3)


def first_wrong_sign(law, seed, excited=600, rest=1500):
    """Return how long b of a tank stays positive after its power has come to rest."""
    rng, y = np.random.default_rng(seed), 37.5
    identifier = Identifier(Arx(1, 1, 1, 20.0, 20.0, 0.5), law, P0=1.0)
    belief = identifier.start()
    for t in range(excited + rest):
        u = float(rng.uniform(0.0, 0.78)) if t < excited else 0.39
        y += 0.0449 * u - 0.001 * (y - 20.0) + 0.02 * rng.normal()
        belief = identifier.update(belief, y, u)
        if t >= excited and belief.estimate.theta[1] <= 0.0:
            return t - excited
    return math.inf


R2 = (0.02 / 20.0) ** 2
CORRECTED = CorrectedKalman(R2=R2)


@pytest.mark.parametrize(
    ("law", "lasts"),
    [
        (CORRECTED, False),
        (Guarded(CORRECTED, covariance_max=1.0), False),
        (Guarded(CORRECTED, covariance_max=1.0, excitation_min=0.1), True),
        (RecursiveLeastSquares(0.99), False),
        (RandomWalkKalman(R2=R2), True),
    ],
    ids=["corrected", "capped", "capped and pausing", "forgetting .99", "normal"],
)
def test_at_rest_a_law_that_forgets_lets_the_gain_drift_through_zero(law, lasts):
    first = np.array([first_wrong_sign(law, seed) for seed in range(5)])
    assert (np.isinf(first) if lasts else np.isfinite(first)).all()


def share_unsound(mean, n, runs=60):
    """Return in how many runs from a vague start P is positive definite no more."""
    lost = 0
    for seed in range(runs):
        rng, belief, law = np.random.default_rng(seed), start(n, 1e8), RandomWalkKalman(R2=1e-5)
        theta, sound = rng.normal(size=n), True
        for _ in range(20):
            phi = mean + 5.0 * rng.normal(size=n)
            belief = law.update(belief, phi, float(phi @ theta) + math.sqrt(1e-5) * rng.normal())
            sound = sound and bool(np.linalg.eigvalsh(belief.P)[0] > 0.0)
        lost += not sound
    return lost / runs


@pytest.mark.parametrize("n", [2, 3, 4])
def test_from_a_vague_start_raw_degrees_cost_the_covariance_its_soundness(n):
    assert share_unsound(37.5, n) > 0.5
    assert share_unsound(0.0, n) < 0.05


def after_a_spike(law, size, n, seed):
    """Return the largest error 40 samples after an output that was off by `size`."""
    rng, belief, sound = np.random.default_rng(seed), start(n), True
    for t in range(120):
        phi = rng.normal(size=n)
        belief = law.update(belief, phi, phi.sum() + rng.normal() + size * (t == 80))
        sound = sound and bool(np.linalg.eigvalsh(belief.P)[0] > 0.0)
    return float(np.abs(belief.theta - 1.0).max()), sound


def test_the_corrected_filter_forgets_a_spike_of_any_size_that_a_sensor_can_show():
    for n in (1, 2, 4):
        errors, sound = zip(
            *(after_a_spike(CorrectedKalman(), 1e7, n, seed) for seed in range(10)), strict=True
        )
        assert all(sound)
        assert np.median(errors) < 0.35
        normal = [after_a_spike(RandomWalkKalman(), 1e3, n, seed)[0] for seed in range(10)]
        assert np.median(normal) > 3.0


def spread_of_eigenvalues(structure):
    """Return how far apart those of the information lie after an hour of switched heating."""
    rng, y, information = np.random.default_rng(1), [37.5, 37.5], np.zeros((3, 3))
    for t in range(3600):
        if t % 120 == 0:
            u = float(rng.choice([0.0, 0.8]))
        phi = structure.regressor(np.array(y), np.array([u]))
        information += np.outer(phi, phi)
        y = [y[0] + 0.0449 * u - 0.001 * (y[0] - 20.0) + 0.02 * rng.normal(), y[0]]
    smallest, *_, largest = np.linalg.eigvalsh(information)
    return largest / smallest


def test_neighbouring_temperatures_are_alike_and_centring_helps_against_that_a_little():
    assert spread_of_eigenvalues(Arx(2, 1)) == pytest.approx(1.5e7, rel=0.1)
    assert spread_of_eigenvalues(Arx(2, 1, 1, 20.0)) == pytest.approx(3.7e6, rel=0.1)
    assert spread_of_eigenvalues(Arx(2, 1, 1, 20.0, 20.0, 0.5)) == pytest.approx(5.8e6, rel=0.1)
