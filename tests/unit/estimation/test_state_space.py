"""The Kalman filter of a known model: against formulas of its own, and on what it refuses."""

import math

import numpy as np
import pytest

from thermoctl.estimation import LinearModel, MatrixFading, MultipleFading, StateKalman, start

F = np.array([[0.9, 0.2], [-0.1, 0.8]])
H = np.array([[0.0, 2.0]])
MODEL = LinearModel(F, H, 0.01 * np.eye(2), 0.5 * np.eye(1))


def random_model(rng, n, m):
    """Return a model with full H, Q and R."""
    q, r = rng.normal(size=(n, n)), rng.normal(size=(m, m))
    return LinearModel(
        0.4 * rng.normal(size=(n, n)), rng.normal(size=(m, n)), q @ q.T, r @ r.T + np.eye(m)
    )


def after(law, observations, x0=(1.0, -1.0), P0=2.0):
    belief = law.start(x0, P0)
    for z in observations:
        belief = law.update(belief, z)
    return belief


@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 1), (3, 2), (2, 4)])
def test_an_update_agrees_with_the_information_form(n, m):
    rng = np.random.default_rng(n + 10 * m)
    model = random_model(rng, n, m)
    belief = StateKalman(model).start(rng.normal(size=n), 3.0)
    for _ in range(20):
        z = rng.normal(size=m)
        P = model.F @ belief.P @ model.F.T + model.Q
        x = model.F @ belief.x
        information = np.linalg.inv(P) + model.H.T @ np.linalg.inv(model.R) @ model.H
        vector = np.linalg.inv(P) @ x + model.H.T @ np.linalg.inv(model.R) @ z
        expected = np.linalg.inv(information)
        belief = StateKalman(model).update(belief, z)
        np.testing.assert_allclose(belief.P, expected, rtol=1e-9, atol=1e-12)
        assert belief.x == pytest.approx(expected @ vector, rel=1e-9, abs=1e-12)
        assert belief.innovation == pytest.approx(z - model.H @ x)
        assert belief.innovation_cov == pytest.approx(model.H @ P @ model.H.T + model.R)


def test_the_belief_does_not_depend_on_the_order_of_the_states():
    rng = np.random.default_rng(5)
    model, order = random_model(rng, 4, 2), np.array([2, 0, 3, 1])
    turned = LinearModel(
        model.F[np.ix_(order, order)], model.H[:, order], model.Q[np.ix_(order, order)], model.R
    )
    x0, observations = rng.normal(size=4), rng.normal(size=(10, 2))
    there = after(StateKalman(model), observations, x0)
    here = after(StateKalman(turned), observations, x0[order])
    assert here.x == pytest.approx(there.x[order], rel=1e-9)
    np.testing.assert_allclose(here.P, there.P[np.ix_(order, order)], rtol=1e-9, atol=1e-12)


def test_the_mean_square_is_that_of_every_innovation_used():
    rng = np.random.default_rng(2)
    law = StateKalman(random_model(rng, 2, 2))
    belief, squares = law.start([0.0, 0.0], 1.0), []
    for k in range(12):
        belief = law.update(belief, [math.nan, 0.0] if k == 6 else rng.normal(size=2))
        if not belief.rejected:
            squares.append(np.outer(belief.innovation, belief.innovation))
        assert belief.samples == len(squares)
    assert len(squares) == 11
    assert belief.mean_square == pytest.approx(np.mean(squares, axis=0))


@pytest.mark.parametrize("z", [math.nan, math.inf, -math.inf, 1e30, 1e200])
def test_an_unusable_observation_leaves_the_belief_but_for_the_mark(z):
    law = StateKalman(MODEL)
    before = after(law, [0.3, 0.1])
    belief = law.update(before, z)
    assert belief.rejected
    assert not before.rejected
    for name in ("x", "P", "innovation", "innovation_cov", "fading", "samples", "mean_square"):
        assert getattr(belief, name) is getattr(before, name)
    assert not law.update(belief, 0.2).rejected


def test_an_update_that_cannot_be_solved_is_a_rejected_one():
    twice = LinearModel(np.eye(2), [[1.0, 0.0], [1.0, 0.0]], 0.0, 1e-6)
    belief = StateKalman(twice).start([0.0, 0.0], 1e20)
    assert StateKalman(twice).update(belief, [1.0, 1.0]).rejected


def test_a_huge_prior_leaves_the_covariance_positive_definite():
    law = StateKalman(LinearModel(np.eye(2), [[1.0, 1e-3]], 0.0, 1e-4))
    belief = law.start([0.0, 0.0], 1e12)
    for z in (1.0, 2.0, 1.5):
        belief = law.update(belief, z)
        assert np.array_equal(belief.P, belief.P.T)
        assert np.linalg.eigvalsh(belief.P)[0] > 0.0


def test_the_arrays_of_a_belief_are_read_only():
    belief = after(StateKalman(MODEL), [0.3])
    for name in ("x", "P", "innovation", "innovation_cov", "fading", "mean_square"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(belief, name)[...] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        MODEL.F[...] = 0.0


def test_a_model_keeps_a_copy_of_what_it_was_given():
    mine = F.copy()
    model = LinearModel(mine, H, 0.0, 1.0)
    mine[0, 0] = 5.0
    assert model.F[0, 0] == 0.9


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("F", np.ones((2, 3))),
        ("F", [[math.nan, 0.0], [0.0, 1.0]]),
        ("F", np.full((2, 2), 1e60)),
        ("F", "none"),
        ("H", np.ones((1, 3))),
        ("H", np.ones(2)),
        ("H", np.ones((0, 2))),
        ("Q", -1.0),
        ("Q", np.eye(3)),
        ("Q", [[1.0, 2.0], [0.0, 1.0]]),
        ("R", 0.0),
        ("R", math.nan),
        ("R", np.eye(2)),
    ],
)
def test_a_model_names_the_matrix_it_refuses(name, value):
    matrices = {"F": F, "H": H, "Q": 0.0, "R": 1.0, name: value}
    with pytest.raises(ValueError, match=rf"^{name} must"):
        LinearModel(**matrices)


@pytest.mark.parametrize(
    ("name", "x0", "P0"),
    [
        ("x0", [1.0], 1.0),
        ("x0", [1.0, math.nan], 1.0),
        ("P0", [1.0, 1.0], -1.0),
        ("P0", [1.0, 1.0], np.eye(3)),
    ],
)
def test_a_start_names_what_it_refuses(name, x0, P0):
    with pytest.raises(ValueError, match=rf"^{name} must"):
        StateKalman(MODEL).start(x0, P0)


@pytest.mark.parametrize("z", [[1.0, 2.0], [[1.0]], [], "warm", None])
def test_an_observation_of_another_shape_or_kind_is_an_error(z):
    law = StateKalman(MODEL)
    with pytest.raises(ValueError, match=r"^z must"):
        law.update(law.start([0.0, 0.0], 1.0), z)


def test_a_belief_about_another_number_of_states_is_an_error():
    other = StateKalman(LinearModel(np.eye(3), np.eye(3)[:1], 0.0, 1.0))
    with pytest.raises(ValueError, match="belief must be one of 2 states, got 3"):
        StateKalman(MODEL).update(other.start(np.zeros(3), 1.0), 0.0)


def test_a_belief_about_another_number_of_observations_is_an_error():
    other = StateKalman(LinearModel(F, np.eye(2), 0.0, 1.0))
    with pytest.raises(ValueError, match="belief must be one of 1 observations, got 2"):
        StateKalman(MODEL).update(other.start(np.zeros(2), 1.0), 0.0)


@pytest.mark.parametrize("filter_of", [StateKalman, MultipleFading, MatrixFading])
def test_what_is_no_model_and_no_belief_is_named(filter_of):
    with pytest.raises(TypeError, match=r"^model must be a LinearModel, got ndarray"):
        filter_of(F)
    with pytest.raises(TypeError, match=r"^belief must be a StateBelief, got Estimate"):
        filter_of(MODEL).update(start(2), 0.0)
