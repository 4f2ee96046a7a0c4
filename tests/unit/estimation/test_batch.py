"""The batch: shapes, refusals, and the Monte Carlo study of O21 (24)."""

import numpy as np
import pytest

from thermoctl.estimation import (
    CorrectedKalman,
    Guarded,
    RandomWalkKalman,
    RecursiveLeastSquares,
    VariableForgetting,
    run_batch,
    start,
)

POLE = np.concatenate((np.full(100, -0.9), np.full(100, 0.9), np.full(200, -0.9)))

# Mean square error of a over all samples and three parts of them, then the median of the last P
# and the residual variance, as an independent program found them with 1,000 replications.
STUDY = [
    (RecursiveLeastSquares(), 0.668, 0.0019, 2.15, 0.259, 3.9e-4, 4.55),
    (RandomWalkKalman(), 0.668, 0.0019, 2.15, 0.259, 3.9e-4, 4.55),
    (RecursiveLeastSquares(0.99), 0.554, 0.0019, 1.48, 0.367, 2.0e-3, 3.78),
    (RecursiveLeastSquares(0.9), 0.115, 0.0101, 0.213, 0.118, 2.5e-2, 1.66),
    (RecursiveLeastSquares(0.8), 0.0854, 0.0320, 0.132, 0.0888, 5.8e-2, 1.56),
    (VariableForgetting(10.0), 0.0708, 0.0109, 0.126, 0.0731, 2.8e-2, 1.50),
    (CorrectedKalman(), 0.0742, 0.0064, 0.139, 0.0759, 1.5e-2, 1.50),
]


@pytest.fixture(scope="module")
def study():
    """Return outputs (400, 1000) and regressors (400, 1000, 1) of O21 (24)."""
    rng = np.random.default_rng(24)
    y = np.full((401, 1000), 10.0)
    for t in range(400):
        y[t + 1] = POLE[t] * y[t] + rng.normal(size=1000)
    return y[1:], y[:-1, :, None]


@pytest.mark.parametrize("row", STUDY, ids=lambda row: repr(row[0]))
def test_the_monte_carlo_study_of_the_paper_comes_out(study, row):
    law, *errors, last_P, residual_variance = row
    run = run_batch(law, *study)
    square = (run.theta[:, :, 0] - POLE[:, None]) ** 2
    parts = (slice(None), slice(0, 100), slice(100, 200), slice(200, 400))
    for part, expected in zip(parts, errors, strict=True):
        per_run = square[part].mean(axis=0)
        # Both programs drew 1,000 runs: the error of the difference, and half a printed digit.
        tolerance = 4 * np.sqrt(2 * per_run.var() / 1000) + 0.005 * expected
        if expected == 0.0019:
            tolerance += 0.00005
        assert per_run.mean() == pytest.approx(expected, abs=tolerance)
    assert np.median(run.P[-1]) == pytest.approx(last_P, rel=0.08)
    assert (run.innovation**2).mean() == pytest.approx(residual_variance, rel=0.02)


@pytest.mark.parametrize(
    ("law", "error"),
    [
        (CorrectedKalman(R2=0.01), 0.531),
        (CorrectedKalman(R2=0.1), 0.172),
        (CorrectedKalman(R2=0.5), 0.069),
        (CorrectedKalman(R2=10.0), 0.468),
        (CorrectedKalman(R2=100.0), 0.645),
        (RandomWalkKalman(0.01), 0.084),
        (VariableForgetting(8.0), 0.068),
        (VariableForgetting(8.0, joint=True), 0.065),
        (VariableForgetting(0.05), 0.416),
    ],
    ids=repr,
)
def test_what_has_to_be_chosen_decides_the_error(study, law, error):
    theta = run_batch(law, *study).theta[:, :, 0]
    assert ((theta - POLE[:, None]) ** 2).mean() == pytest.approx(error, rel=0.03)


def test_joint_forgetting_follows_the_paper_s_jumps_at_least_as_well(study):
    joint = run_batch(VariableForgetting(10.0, joint=True), *study).theta[:, :, 0]
    plain = run_batch(VariableForgetting(10.0), *study).theta[:, :, 0]
    assert ((joint - POLE[:, None]) ** 2).mean() < ((plain - POLE[:, None]) ** 2).mean()


def test_with_a_perfect_model_the_correction_fires_on_the_share_of_samples_theory_says():
    rng = np.random.default_rng(3)
    for n, share in ((1, 0.157), (2, 0.083), (3, 0.046), (4, 0.025)):
        phi = rng.normal(size=(1000, 200, n))
        run = run_batch(
            CorrectedKalman(inflation_max=1.0 + 1e-12), rng.normal(size=(1000, 200)), phi
        )
        assert (run.inflation[100:] > 1.0).mean() == pytest.approx(share, abs=0.004)


def test_the_shapes_of_a_run_are_those_of_its_samples():
    run = run_batch(CorrectedKalman(), np.zeros((5, 3)), np.ones((5, 3, 2)))
    assert run.theta.shape == (5, 3, 2)
    assert run.P.shape == (5, 3, 2, 2)
    assert run.innovation.shape == run.inflation.shape == (5, 3)
    for array in (run.theta, run.P, run.innovation, run.inflation):
        assert not array.flags.writeable


@pytest.mark.parametrize(
    ("y", "phi", "name"),
    [
        (np.zeros(5), np.zeros((5, 1, 1)), "y"),
        (np.zeros((5, 2)), np.zeros((5, 3, 1)), "phi"),
        (np.zeros((5, 2)), np.zeros((5, 2)), "phi"),
        (np.zeros((5, 2)), np.zeros((5, 2, 0)), "phi"),
    ],
)
def test_samples_of_the_wrong_shape_are_named(y, phi, name):
    with pytest.raises(ValueError, match=f"^{name} "):
        run_batch(CorrectedKalman(), y, phi)


@pytest.mark.parametrize("wrong", ["warm", "1", None, 1j])
@pytest.mark.parametrize("name", ["y", "phi"])
def test_samples_that_are_no_numbers_are_named(name, wrong):
    samples = {"y": [[1.0, 2.0]], "phi": [[[1.0], [2.0]]]}
    row = samples[name][0]
    row[1] = wrong if name == "y" else [wrong]
    with pytest.raises(ValueError, match=f"^{name} must consist of numbers, got "):
        run_batch(CorrectedKalman(), **samples)


def test_a_drift_and_a_start_that_do_not_fit_are_named():
    y, phi = np.zeros((5, 2)), np.zeros((5, 2, 3))
    with pytest.raises(ValueError, match="R1"):
        run_batch(CorrectedKalman(np.eye(2)), y, phi)
    with pytest.raises(ValueError, match="P0"):
        run_batch(CorrectedKalman(), y, phi, P0=np.eye(2))
    with pytest.raises(ValueError, match="theta0"):
        run_batch(CorrectedKalman(), y, phi, theta0=[1.0])


def test_a_guarded_law_is_refused_because_it_has_a_memory():
    with pytest.raises(TypeError, match="Guarded"):
        run_batch(Guarded(CorrectedKalman()), np.zeros((5, 2)), np.zeros((5, 2, 1)))


def test_a_covariance_that_would_overflow_is_refused_in_one_replication_only():
    phi = np.ones((60, 2, 1))
    phi[:, 0] = 0.0
    P = run_batch(RecursiveLeastSquares(0.01), np.zeros((60, 2)), phi).P[-1, :, 0, 0]
    assert 1e45 < P[0] < 1e51
    assert P[1] == pytest.approx(0.99)


def test_a_run_of_no_samples_is_empty():
    run = run_batch(CorrectedKalman(), np.zeros((0, 2)), np.zeros((0, 2, 1)))
    assert run.theta.shape == (0, 2, 1)


@pytest.mark.parametrize("T", [1, 7, 8, 9, 40])
@pytest.mark.parametrize("law", [CorrectedKalman(R2=0.3), CorrectedKalman(R2=0.3, inflation_max=2)])
def test_a_batch_of_one_parameter_is_the_loop_however_long_it_is(law, T):
    rng = np.random.default_rng(5)
    phi = rng.normal(size=(T, 3, 1))
    y = np.where(np.arange(T) < 20, 0.5, -3.0)[:, None] * phi[:, :, 0] + rng.normal(size=(T, 3))
    run = run_batch(law, y, phi, P0=2.0, theta0=[0.4])
    for r in range(3):
        belief = start(1, 2.0, [0.4])
        for t in range(T):
            belief = law.update(belief, phi[t, r], y[t, r])
            assert run.theta[t, r] == pytest.approx(belief.theta, rel=1e-10)
            assert run.P[t, r] == pytest.approx(belief.P, rel=1e-10)
            assert run.innovation[t, r] == pytest.approx(belief.innovation, rel=1e-10)
            assert run.inflation[t, r] == pytest.approx(belief.inflation, rel=1e-10)
