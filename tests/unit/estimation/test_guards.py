"""The guards: what they bound, what they pause, what they leave alone."""

import math

import numpy as np
import pytest

from thermoctl.estimation import (
    CorrectedKalman,
    Guarded,
    RandomWalkKalman,
    RecursiveLeastSquares,
    run_batch,
    start,
)


def years(law, samples, seed=11):
    """Return the largest error of theta over long rests with a short excitation in between."""
    rng, truth, worst = np.random.default_rng(seed), np.array([1.0, -0.5, 0.25]), 0.0
    belief = start(3, P0=2.0)
    for t in range(samples):
        moved = rng.normal(size=3) if t % 1000 < 60 else 0.02 * rng.normal(size=3)
        phi = np.array([1.0, 0.25, -0.5]) + moved
        belief = law.update(belief, phi, float(phi @ truth) + 0.1 * rng.normal())
        if t > 100:
            worst = max(worst, float(np.abs(belief.theta - truth).max()))
    return worst


def test_cap_and_pause_together_keep_what_was_learned_where_the_cap_alone_drifts():
    law = CorrectedKalman(R2=0.01)
    assert years(Guarded(law, covariance_max=2.0), 6000) > 1.0
    assert years(Guarded(law, covariance_max=2.0, excitation_min=0.5), 6000) < 0.5


@pytest.mark.slow
def test_cap_and_pause_together_keep_what_was_learned_for_a_hundred_thousand_samples():
    law = Guarded(CorrectedKalman(R2=0.01), covariance_max=2.0, excitation_min=0.5)
    assert years(law, 100_000) < 0.7


def test_the_cap_keeps_correlations():
    P0 = np.array([[9.0, 2.0], [2.0, 1.0]])
    law = Guarded(RandomWalkKalman(0.0, 1.0), covariance_max=4.0)
    P = law.update(start(2, P0), np.zeros(2), 0.0).P
    np.testing.assert_allclose(P, [[4.0, 2.0 * 2 / 3], [2.0 * 2 / 3, 1.0]])
    assert not P.flags.writeable


def test_the_cap_takes_variances_however_far_apart():
    law = Guarded(RandomWalkKalman(), covariance_max=1e30)
    P = law.update(start(2, np.diag([1e40, 1e-300])), np.zeros(2), 0.0).P
    np.testing.assert_allclose(P, np.diag([1e30, 1e-300]), rtol=1e-12)


def test_learning_pauses_at_rest_and_goes_on_when_the_regressor_moves():
    law, rng = Guarded(CorrectedKalman(R2=0.01), excitation_min=0.3), np.random.default_rng(2)
    belief, learned = start(2), []
    for t in range(600):
        moving = 200 <= t < 300
        phi = np.array([1.0 + moving * math.sin(t / 5), 0.05 * rng.normal()])
        before = belief
        belief = law.update(belief, phi, 0.7 * phi[0] + 0.1 * rng.normal())
        learned.append(belief.theta is not before.theta)
        assert belief.rejected is not learned[-1]
        assert learned[-1] or belief.P is before.P
    assert not any(learned[:200])
    assert all(learned[220:300])
    assert not any(learned[500:])
    assert belief.theta[0] == pytest.approx(0.7, abs=0.1)


def test_a_paused_sample_still_tells_its_innovation():
    law = Guarded(CorrectedKalman(), excitation_min=1.0)
    belief = law.update(start(1, theta0=[2.0]), np.ones(1), 5.0)
    assert belief.rejected
    assert (belief.innovation, belief.innovation_var, belief.inflation) == (3.0, 2.0, 1.0)


def test_excitation_is_the_spread_of_the_regressor():
    rng, law = np.random.default_rng(6), Guarded(RecursiveLeastSquares(), excitation_min=1.0)
    belief, seen = start(2), []
    for _ in range(3000):
        belief = law.update(belief, 40.0 + rng.normal(size=2) * [3.0, 4.0], 0.0)
        seen.append(belief.excitation**2)
    assert np.mean(seen[500:]) == pytest.approx(25.0, rel=0.1)


def test_excitation_is_not_reckoned_for_nobody():
    belief = Guarded(RecursiveLeastSquares()).update(start(1), np.ones(1), 1.0)
    assert math.isnan(belief.excitation)


def jumping_pole(runs):
    """Return O21's simulation (24) and its pole."""
    a = np.concatenate((np.full(100, -0.9), np.full(100, 0.9), np.full(200, -0.9)))
    rng, y = np.random.default_rng(24), np.full((401, runs), 10.0)
    for t in range(400):
        y[t + 1] = a[t] * y[t] + rng.normal(size=runs)
    return y, a


@pytest.mark.parametrize("R2", [0.01, 100.0])
def test_a_robust_noise_variance_rescues_a_filter_told_a_hundredfold_wrong_one(R2):
    y, a = jumping_pole(20)
    law, square = Guarded(CorrectedKalman(R2=R2), robust_R2=True), []
    for r in range(20):
        belief = start(1)
        for t in range(400):
            belief = law.update(belief, y[t, r : r + 1], float(y[t + 1, r]))
            square.append((belief.theta[0] - a[t]) ** 2)
        assert 0.2 < belief.R2 < 1.8
    bare = run_batch(CorrectedKalman(R2=R2), y[1:], y[:-1, :, None]).theta[:, :, 0]
    assert np.mean((bare - a[:, None]) ** 2) > 0.4
    assert np.mean(square) < 0.11


@pytest.mark.parametrize(("n", "excess"), [(1, 1.1), (4, 1.25)])
def test_a_robust_noise_variance_is_the_variance_and_what_theta_adds_to_it(n, excess):
    rng, law, found = np.random.default_rng(5), Guarded(RandomWalkKalman(), robust_R2=True), []
    belief = start(n)
    for _ in range(3000):
        belief = law.update(belief, rng.normal(size=n), 2.0 * rng.normal())
        found.append(belief.R2)
    assert np.mean(found[100:]) == pytest.approx(4.0 * excess, rel=0.07)


@pytest.mark.parametrize(("R2", "y"), [(1.0, 9e24), (1e-46, 0.0), (1e-50, 0.0)])
def test_a_robust_noise_variance_past_all_use_does_not_stop_the_loop(R2, y):
    law, belief = Guarded(RandomWalkKalman(R2=R2), robust_R2=True), start(1)
    for _ in range(20):
        belief = law.update(belief, np.zeros(1), y)
    assert belief.R2 in (pytest.approx(1e-50), pytest.approx(1e50))


def test_a_robust_noise_variance_of_constant_readings_stays_above_zero():
    law, belief = Guarded(CorrectedKalman(R2=0.01), robust_R2=True), start(1, theta0=[1.0])
    for _ in range(100):
        belief = law.update(belief, np.ones(1), 1.0)
    assert math.isclose(belief.R2, 1e-8)
    assert len(belief._memory.residuals) == 60  # what is remembered does not grow
    assert not belief.rejected


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        *(("covariance_max", {"covariance_max": v}) for v in (0.0, -1.0, math.nan)),
        *(("excitation_min", {"excitation_min": v}) for v in (0.0, -1.0, math.inf)),
    ],
)
def test_a_limit_that_is_not_positive_is_named(name, arguments):
    with pytest.raises(ValueError, match=name):
        Guarded(CorrectedKalman(), **arguments)


def test_guards_refuse_what_they_cannot_guard():
    with pytest.raises(ValueError, match="robust_R2"):
        Guarded(RecursiveLeastSquares(), robust_R2=True)
    for wrong in (1, "no", None):
        with pytest.raises(ValueError, match=r"^robust_R2 must be True or False, got "):
            Guarded(CorrectedKalman(), robust_R2=wrong)
    with pytest.raises(TypeError, match="Guarded"):
        Guarded(Guarded(CorrectedKalman()))
    with pytest.raises(ValueError, match="phi"):
        Guarded(CorrectedKalman()).update(start(2), np.ones(3), 1.0)
