"""The four bare laws: what is special to each, and what they refuse by name."""

import math

import numpy as np
import pytest

from thermoctl.estimation import (
    CorrectedKalman,
    Estimate,
    Guarded,
    LinearModel,
    RandomWalkKalman,
    RecursiveLeastSquares,
    StateKalman,
    VariableForgetting,
    start,
)

WALK = LinearModel(np.eye(1), np.eye(1), 0.0, 1.0)
LAWS = [
    RecursiveLeastSquares(0.95),
    VariableForgetting(5.0),
    VariableForgetting(5.0, joint=True),
    RandomWalkKalman(0.01, 0.5),
    CorrectedKalman(0.01, 0.5),
]
by_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)


def samples(n, T, seed=1, noise=0.5):
    """Return regressors (T, n) and outputs (T,) of a plant with constant parameters."""
    rng = np.random.default_rng(seed)
    phi = rng.normal(size=(T, n))
    return phi, phi @ rng.normal(size=n) + noise * rng.normal(size=T)


def taught(law, belief, phi, y):
    for regressor, output in zip(phi, y, strict=True):
        belief = law.update(belief, regressor, float(output))
    return belief


def test_inflation_never_exceeds_its_maximum():
    belief = CorrectedKalman(inflation_max=4.0).update(start(1), np.ones(1), 1e3)
    assert belief.inflation == 4.0
    assert belief.P.item() == pytest.approx(4.0 * 0.5)


def test_variable_forgetting_forgets_nothing_when_nothing_surprises():
    phi, _ = samples(2, 30)
    belief = taught(VariableForgetting(10.0), start(2), phi, np.zeros(30))
    assert belief.inflation == 1.0
    np.testing.assert_array_equal(belief.theta, np.zeros(2))


def test_variable_forgetting_keeps_at_least_its_minimum():
    belief = VariableForgetting(1.0, forgetting_min=0.4).update(start(1), np.ones(1), 100.0)
    assert belief.inflation == pytest.approx(1 / 0.4)


@pytest.mark.parametrize(
    ("P0", "phi", "y", "forgetting"),
    [
        (1e8, 1e2, 3e6, 0.1),
        (1e8, 1e4, 1e8, 0.5),
        (1.0, 1.0, 1e3, 1e-6),
        (1e-8, 1.0, 1e-9, 1.0),
        (1.0, 0.0, 2.0, 1e-12),
        (1.0, 0.0, 1.0, 1e-12),
        (1.0, 0.0, 0.5, 0.75),
    ],
)
def test_joint_forgetting_keeps_its_digits_however_large_the_terms(P0, phi, y, forgetting):
    belief = VariableForgetting(1.0, 1e-12, joint=True).update(start(1, P0), np.full(1, phi), y)
    assert belief.inflation == pytest.approx(1.0 / forgetting, rel=1e-5)


def test_joint_forgetting_satisfies_the_circular_equations_as_printed():
    Sigma0, law = 8.0, VariableForgetting(8.0, forgetting_min=1e-9, joint=True)
    phi, y = samples(3, 200, noise=1.0)
    belief = start(3)
    for regressor, output in zip(phi, y, strict=True):
        new = law.update(belief, regressor, output)
        forgetting = 1.0 / new.inflation
        L = belief.P @ regressor / (forgetting + regressor @ belief.P @ regressor)  # O21 (12)
        printed = 1.0 - (1.0 - regressor @ L) * new.innovation**2 / Sigma0  # O21 (14)
        assert forgetting == pytest.approx(printed, rel=1e-9)
        assert 0.0 < forgetting <= 1.0
        np.testing.assert_allclose(new.theta, belief.theta + L * new.innovation, rtol=1e-9)
        np.testing.assert_allclose(L, new.P @ regressor, rtol=1e-6, atol=1e-9)  # O21 (12), right
        belief = new


@by_law
@pytest.mark.parametrize("negative", [-1e-18, -0.5, -1.0, -1e6])
def test_a_covariance_that_is_none_any_more_does_not_stop_the_loop(law, negative):
    indefinite = Estimate(np.zeros(1), np.full((1, 1), negative))
    belief = law.update(indefinite, np.ones(1), 0.5)
    assert belief.innovation_var > 0.0
    assert math.isfinite(belief.P.item())


def test_a_covariance_that_would_overflow_is_refused_before_it_does():
    law, belief = RecursiveLeastSquares(0.01), start(1)
    for _ in range(200):
        belief = law.update(belief, np.zeros(1), 0.0)
    assert belief.rejected
    assert 1e45 < belief.P.item() < math.inf


@by_law
@pytest.mark.parametrize("phi", [np.ones(1), np.ones(3), np.ones((1, 2)), np.float64(1.0)])
def test_a_regressor_of_the_wrong_shape_is_named(law, phi):
    with pytest.raises(ValueError, match="phi"):
        law.update(start(2), phi, 1.0)


def test_a_drift_of_another_size_than_the_belief_is_named():
    for law in (
        RandomWalkKalman(np.eye(2)),
        RandomWalkKalman(np.eye(1)),
        CorrectedKalman(np.eye(2)),
    ):
        with pytest.raises(ValueError, match="R1"):
            law.update(start(3), np.ones(3), 1.0)


@pytest.mark.parametrize(
    ("name", "build"),
    [
        *(("forgetting", lambda v=v: RecursiveLeastSquares(v)) for v in (0.0, 1.1, math.nan, "1")),
        *(("Sigma0", lambda v=v: VariableForgetting(v)) for v in (0.0, -1.0, math.nan, math.inf)),
        *(("forgetting_min", lambda v=v: VariableForgetting(1.0, v)) for v in (0.0, 1.5, math.nan)),
        ("joint", lambda: VariableForgetting(1.0, 0.2, joint=1)),
        *(
            ("R2", lambda law=law, v=v: law(R2=v))
            for law in (RandomWalkKalman, CorrectedKalman)
            for v in (0.0, -1.0, math.nan, math.inf, 1e60, 1e-60, np.ones(1))
        ),
        *(
            ("R1", lambda law=law, v=v: law(R1=v))
            for law in (RandomWalkKalman, CorrectedKalman)
            for v in (-1e-9, math.nan, math.inf, "x", np.ones(2), np.ones((2, 3)), np.ones((0, 0)))
        ),
        *(
            (name, lambda build=build, v=v: build(v))
            for name, build in (
                ("R1", lambda v: CorrectedKalman(R1=v)),
                ("P0", lambda v: start(2, v)),
            )
            for v in (
                [[1.0, 2.0], [3.0]],
                np.eye(2) > 0.0,
                1j * np.eye(2),
                [["1", "0"], ["0", "1"]],
            )
        ),
        ("R1", lambda: CorrectedKalman(R1=[[1.0, 0.5], [0.0, 1.0]])),
        ("R1", lambda: CorrectedKalman(R1=np.diag([1.0, -0.1]))),
        ("R1", lambda: CorrectedKalman(R1=np.diag([1.0, math.nan]))),
        *(
            ("inflation_max", lambda v=v: CorrectedKalman(inflation_max=v))
            for v in (0.9, math.nan, -math.inf, None, np.ones(2))
        ),
        *(("n", lambda v=v: start(v)) for v in (0, -1, 1.5, True)),
        *(
            ("P0", lambda v=v: start(2, P0=v))
            for v in (
                -1.0,
                math.nan,
                math.inf,
                True,
                "1.0",
                np.eye(3),
                np.ones(2),
                [[1, 2], [2, 1]],
                [[1, 1], [0, 1]],
            )
        ),
        *(
            ("theta0", lambda v=v: start(2, theta0=v))
            for v in ([1.0], [1.0, math.nan], np.ones((2, 1)), "ab", [True, False], [0, 1e60])
        ),
    ],
)
def test_a_constructor_names_the_argument_that_is_wrong_on_one_line(name, build):
    with pytest.raises(ValueError, match=rf"^{name} must") as refusal:
        build()
    assert "\n" not in str(refusal.value)


def test_a_number_past_all_use_is_refused_with_the_range_expected():
    for R2 in (1e-60, 1e60):
        with pytest.raises(ValueError, match=r"^R2 must be positive, from 1e-50 to 1e\+50, got 1e"):
            RandomWalkKalman(R2=R2)


def test_a_start_that_is_symmetric_but_for_rounding_is_made_symmetric():
    P0 = np.array([[2.0, 0.3], [0.3 + 1e-15, 1.0]])
    assert P0[0, 1] != P0[1, 0]
    assert np.array_equal(start(2, P0).P, start(2, P0).P.T)
    assert np.array_equal(CorrectedKalman(P0).R1, CorrectedKalman(P0).R1.T)


def test_a_law_keeps_its_own_copy_of_its_constants():
    R1, P0, theta0 = np.eye(2), np.eye(2), np.zeros(2)
    law, belief = CorrectedKalman(R1), start(2, P0, theta0)
    R1[:], P0[:], theta0[:] = 9.0, 9.0, 9.0
    assert np.array_equal(law.R1, np.eye(2))
    assert np.array_equal(belief.P, np.eye(2))
    assert np.array_equal(belief.theta, np.zeros(2))


@by_law
@pytest.mark.parametrize("y", [None, "3", "warm", 1j, True, np.True_, 10**400])
def test_an_output_that_is_no_number_is_named(law, y):
    with pytest.raises(ValueError, match=r"^y must be a number, got ") as refusal:
        law.update(start(2), np.ones(2), y)
    assert len(str(refusal.value)) < 300


@by_law
@pytest.mark.parametrize("belief", [None, StateKalman(WALK).start([0.0], 1.0)])
def test_what_is_no_belief_is_named(law, belief):
    for each in (law, Guarded(law)):
        with pytest.raises(TypeError, match=r"^belief must be an Estimate, got "):
            each.update(belief, np.ones(2), 1.0)


@by_law
def test_an_output_of_several_numbers_is_named(law):
    for y in ([1.0, 2.0], np.ones(1)):
        with pytest.raises(ValueError, match=r"^y must be a single number, got "):
            law.update(start(2), np.ones(2), y)


@by_law
@pytest.mark.parametrize("phi", [["1", "2"], [None, 1.0], "12", [1j, 1.0], [True, False]])
def test_a_regressor_that_is_no_number_is_named(law, phi):
    with pytest.raises(ValueError, match="phi must consist of numbers, got "):
        law.update(start(2), phi, 1.0)


def test_an_output_of_half_the_precision_is_not_rounded_further():
    y, theta0 = np.float32(0.1), [1.0 / 3.0]
    learnt = RandomWalkKalman().update(start(1, theta0=theta0), np.ones(1), y)
    assert learnt.innovation == float(y) - 1.0 / 3.0
