"""Symmetries no estimator may break, for any data."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.estimation import (
    CorrectedKalman,
    RandomWalkKalman,
    RecursiveLeastSquares,
    VariableForgetting,
    run_batch,
    start,
)

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 4)
quickly = settings(max_examples=25, deadline=None, derandomize=True)


def laws(R1, R2, unit=1.0):
    """Return all laws, with variances of y counted in `unit` squared."""
    return [
        RecursiveLeastSquares(0.97),
        VariableForgetting(3.0 * unit**2),
        VariableForgetting(3.0 * unit**2, joint=True),
        RandomWalkKalman(R1, R2 * unit**2),
        CorrectedKalman(R1, R2 * unit**2),
    ]


def covariance(rng, n):
    A = rng.normal(size=(n, n))
    return A @ A.T + 0.1 * np.eye(n)


def run(law, phi, y, P0):
    belief = start(phi.shape[1], P0)
    for regressor, output in zip(phi, y, strict=True):
        belief = law.update(belief, regressor, float(output))
    return belief


@quickly
@given(seeds, sizes)
def test_permuting_the_regressor_permutes_the_belief(seed, n):
    rng = np.random.default_rng(seed)
    phi, y, P0, R1 = (
        rng.normal(size=(30, n)),
        rng.normal(size=30),
        *(covariance(rng, n) for _ in "ab"),
    )
    order = rng.permutation(n)
    turned = np.ix_(order, order)
    for law, moved in zip(laws(R1, 0.5), laws(R1[turned], 0.5), strict=True):
        a, b = run(law, phi, y, P0), run(moved, phi[:, order], y, P0[turned])
        np.testing.assert_allclose(a.theta[order], b.theta, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(a.P[turned], b.P, rtol=1e-8, atol=1e-9)


@quickly
@given(seeds, sizes)
def test_turning_the_sign_of_the_output_turns_only_theta(seed, n):
    rng = np.random.default_rng(seed)
    phi, y, P0 = rng.normal(size=(30, n)), rng.normal(size=30), covariance(rng, n)
    for law in laws(0.01, 0.5):
        a, b = run(law, phi, y, P0), run(law, phi, -y, P0)
        assert np.array_equal(a.theta, -b.theta)
        assert np.array_equal(a.P, b.P)


@quickly
@given(seeds, sizes, st.sampled_from([0.25, 3.0, 100.0]))
def test_a_change_of_the_unit_of_y_scales_theta_alone_in_the_kalman_filters(seed, n, unit):
    rng = np.random.default_rng(seed)
    phi, y, P0, R1 = (
        rng.normal(size=(30, n)),
        rng.normal(size=30),
        *(covariance(rng, n) for _ in "ab"),
    )
    for law, scaled in zip(laws(R1, 0.5)[3:], laws(R1 * unit**2, 0.5, unit)[3:], strict=True):
        a, b = run(law, phi, y, P0), run(scaled, phi, unit * y, P0 * unit**2)
        np.testing.assert_allclose(b.theta, unit * a.theta, rtol=1e-8, atol=1e-9 * unit)
        np.testing.assert_allclose(b.P, unit**2 * a.P, rtol=1e-8, atol=1e-9 * unit**2)
        assert b.inflation == pytest.approx(a.inflation, rel=1e-8)


@quickly
@given(seeds, sizes, st.sampled_from([0.25, 3.0, 100.0]))
def test_a_change_of_the_unit_of_y_scales_theta_alone_in_least_squares(seed, n, unit):
    rng = np.random.default_rng(seed)
    phi, y, P0 = rng.normal(size=(30, n)), rng.normal(size=30), covariance(rng, n)
    for law, scaled in zip(laws(0.0, 1.0)[:3], laws(0.0, 1.0, unit)[:3], strict=True):
        a, b = run(law, phi, y, P0), run(scaled, phi, unit * y, P0)
        np.testing.assert_allclose(b.theta, unit * a.theta, rtol=1e-7, atol=1e-9 * unit)
        np.testing.assert_allclose(b.P, a.P, rtol=1e-7, atol=1e-9)


@quickly
@given(seeds, sizes)
def test_a_batch_equals_a_loop_over_its_replications_gaps_included(seed, n):
    rng = np.random.default_rng(seed)
    T, R = 40, 5
    phi = rng.normal(size=(T, R, n))
    y = phi @ rng.normal(size=n) + rng.normal(size=(T, R))
    y[7, 2], phi[11, 3, n - 1], y[0, 4], phi[20, 0, 0] = np.nan, np.inf, 1e200, np.nan
    phi[30, 1] = 1e60
    P0, theta0, R1 = covariance(rng, n), rng.normal(size=n), 0.01 * covariance(rng, n)
    for law in laws(R1, 0.5):
        batch = run_batch(law, y, phi, P0, theta0)
        for r in range(R):
            beliefs = [start(n, P0, theta0)]
            for t in range(T):
                beliefs.append(law.update(beliefs[-1], phi[t, r], float(y[t, r])))
            for name in ("theta", "P", "innovation", "inflation"):
                looped = np.array([getattr(belief, name) for belief in beliefs[1:]])
                np.testing.assert_allclose(
                    getattr(batch, name)[:, r], looped, rtol=1e-12, atol=1e-12
                )
