"""The fading filters of BO17: its compartment study, and what is special to each of them."""

import math
from functools import cache

import numpy as np
import pytest

from thermoctl.estimation import LinearModel, MatrixFading, MultipleFading, StateKalman
from thermoctl.estimation.fading import Criterion
from thermoctl.estimation.state_space import Prediction

PRINTED = {"normalised": False, "max_iterations": 1000, "s_min": -math.inf, "s_max": math.inf}


def compartments(c1, c2):
    return np.array([[1.0 - 0.1 * c1, 0.0], [0.1 * c1, 1.0 - 0.1 * c2]])  # BO17 (34)


STUDY = LinearModel(compartments(0.7, 0.3), [[0.0, 1.0]], 1e-5, 1e-2)


@cache
def study(replications=5):
    """Return states (r, 100, 2) and observations (r, 100) of Table 1; the rates change after 37."""
    rng = np.random.default_rng(0)
    states = np.empty((replications, 100, 2))
    x = np.full((replications, 2), 10.0)
    for k in range(100):
        transition = compartments(0.9, 0.1) if k <= 37 else compartments(0.6, 0.4)
        x = x @ transition.T + math.sqrt(1e-9) * rng.normal(size=x.shape)
        states[:, k] = x
    return states, states[:, :, 1] + math.sqrt(1e-6) * rng.normal(size=states.shape[:2])


@pytest.mark.parametrize(
    ("law", "error"),
    [
        (StateKalman(STUDY), 384.4),
        (MultipleFading(STUDY), 80.9),
        (MatrixFading(STUDY, **PRINTED), 25.92),
        (MatrixFading(STUDY, s_min=0.2), 25.79),
        (MatrixFading(STUDY, s_min=0.5), 22.37),
    ],
    ids=["kalman", "filter 1", "filter 2 as printed", "s from .2", "s from .5"],
)
def test_the_compartment_study_gives_the_errors_of_the_theory(law, error):
    states, observations = study()
    squares = 0.0
    for truth, seen in zip(states, observations, strict=True):
        belief = law.start([7.0, 7.0], 1.0)
        for x, z in zip(truth, seen, strict=True):
            belief = law.update(belief, z)
            squares += float(((belief.x - x) ** 2).sum())
    assert squares / len(states) == pytest.approx(error, rel=2e-3)


def whole_T(model, J, C, s):
    """Return all of BO17 (29), every row, the gain computed from `s`."""
    S = np.diag(s)
    P = S @ J @ S + model.Q
    K = P @ model.H.T @ np.linalg.inv(model.H @ P @ model.H.T + model.R)
    return P @ model.H.T - K @ C


def random_model(rng, n, columns, drift=0.1):
    """Return a model whose row r observes state ``columns[r]``, with a full Q."""
    q = drift * rng.normal(size=(n, n))
    H = np.zeros((len(columns), n))
    H[range(len(columns)), columns] = rng.uniform(0.5, 2.0, size=len(columns))
    F = 0.5 * np.eye(n) + 0.2 * rng.normal(size=(n, n))
    return LinearModel(F, H, q @ q.T + 0.01 * np.eye(n), np.diag(rng.uniform(0.1, 0.5, H.shape[0])))


LAWS = {
    "filter 1": MultipleFading,
    "filter 2": MatrixFading,
    "bounded": lambda model: MatrixFading(model, tau=0.3, delta=1e-9, s_min=0.4, s_max=1.2),
    "as printed": lambda model: MatrixFading(model, **{**PRINTED, "max_iterations": 5}, tau=0.01),
}
by_law = pytest.mark.parametrize("build", LAWS.values(), ids=LAWS)


def prediction_of(model, rng):
    """Return an arbitrary moment of a run."""
    root, v = rng.normal(size=(model.n, model.n)), rng.normal(size=model.m)
    C = np.outer(v, v) + 0.3 * np.eye(model.m)
    return Prediction(rng.normal(size=model.n), root @ root.T, v, C)


def test_the_gradient_is_that_of_the_whole_criterion():
    rng = np.random.default_rng(8)
    model = random_model(rng, 5, [3, 1])
    moment = prediction_of(model, rng)
    s, hidden = rng.uniform(0.5, 1.5, 5), np.array([0, 2, 4])
    criterion = Criterion.of(model, moment, s, hidden)
    for place, i in enumerate(hidden):
        step = 1e-5 * np.eye(5)[i]
        high, low = (
            (whole_T(model, moment.J, moment.C, s + sign * step) ** 2).sum() for sign in (1, -1)
        )
        expected = pytest.approx((high - low) / 2e-5, rel=1e-6)
        assert criterion.gradient(s[hidden])[place] == expected


def test_an_adapted_innovation_lies_at_the_confidence_limit():
    law = MultipleFading(STUDY, confidence=0.95)
    belief = law.update(law.start([7.0, 7.0], 1.0), 15.0)
    assert belief.fading[1] > 1.5
    assert belief.innovation[0] ** 2 / belief.innovation_cov[0, 0] == pytest.approx(3.8414588)


@pytest.mark.parametrize(("confidence", "point"), [(0.5, 0.45494), (0.9, 2.70554), (0.99, 6.6349)])
def test_the_limit_is_the_chi_square_point_of_the_confidence(confidence, point):
    assert MultipleFading(STUDY, confidence).critical == pytest.approx(point, rel=1e-5)


def assert_same(here, there):
    for name in ("x", "P", "innovation", "innovation_cov", "fading", "mean_square"):
        assert np.array_equal(getattr(here, name), getattr(there, name)), name


def run_beside(law, other, size):
    """Assert that two laws agree on 30 observations of that size; return what one faded."""
    rng = np.random.default_rng(1)
    here, there = (each.start([0.0, 0.0], 0.1) for each in (law, other))
    largest = 1.0
    for _ in range(30):
        z = size * rng.normal()
        here, there = law.update(here, z), other.update(there, z)
        assert_same(here, there)
        largest = max(largest, float(here.fading.max()))
    return largest


def test_filter_1_is_the_kalman_filter_while_nothing_surprises_it():
    assert run_beside(MultipleFading(STUDY), StateKalman(STUDY), 0.01) == 1.0


@pytest.mark.parametrize("settings", [{"s_min": 1.0, "s_max": 1.0}, {"gate": 1e9}], ids=str)
def test_filter_2_without_leave_to_search_is_filter_1(settings):
    assert run_beside(MatrixFading(STUDY, **settings), MultipleFading(STUDY), 3.0) > 1.5


def test_the_gate_opens_at_its_value_of_the_normalised_innovation_squared():
    z = 9.0
    plain = StateKalman(STUDY).update(StateKalman(STUDY).start([7.0, 7.0], 1.0), z)
    squared = plain.innovation[0] ** 2 / plain.innovation_cov[0, 0]
    for factor, searched in ((0.999, True), (1.001, False)):
        law = MatrixFading(STUDY, gate=factor * squared)
        assert (law.update(law.start([7.0, 7.0], 1.0), z).fading[0] != 1.0) == searched


def test_the_search_ends_where_an_unobserved_state_is_no_longer_corrected():
    law = MatrixFading(STUDY, max_iterations=1000, delta=1e-30)
    belief = law.update(law.start([7.0, 7.0], 1.0), 15.0)
    assert belief.fading[0] == pytest.approx(0.0, abs=1e-9)
    assert belief.x[0] == pytest.approx((STUDY.F @ [7.0, 7.0])[0], abs=1e-8)
    assert abs(belief.x[1] - 15.0) < 0.1


@pytest.mark.parametrize(("settings", "steps"), [({}, 20), ({"max_iterations": 3}, 3)], ids=str)
def test_each_step_takes_a_factor_the_same_part_of_the_way_to_zero(settings, steps):
    law = MatrixFading(STUDY, tau=0.1, delta=1e-30, **settings)
    belief = law.update(law.start([7.0, 7.0], 1.0), 15.0)
    assert belief.fading[0] == pytest.approx((1.0 - 2.0 * 0.1) ** steps, rel=1e-9)


@by_law
def test_a_run_does_not_depend_on_the_order_of_the_states(build):
    rng = np.random.default_rng(3)
    model, order = random_model(rng, 4, [1, 3]), np.array([3, 0, 1, 2])
    turned = LinearModel(
        model.F[np.ix_(order, order)], model.H[:, order], model.Q[np.ix_(order, order)], model.R
    )
    x0, observations = rng.normal(size=4), 3.0 * rng.normal(size=(20, 2))
    here, there = build(turned).start(x0[order], 1.0), build(model).start(x0, 1.0)
    for z in observations:
        here, there = build(turned).update(here, z), build(model).update(there, z)
        assert here.fading == pytest.approx(there.fading[order], rel=1e-8)
        assert here.x == pytest.approx(there.x[order], rel=1e-8, abs=1e-10)


def test_a_search_that_diverges_leaves_the_factors_of_filter_1():
    wild = LinearModel(np.eye(2), [[0.0, 1.0]], 1.0, 1.0)
    P0 = [[1e4, 5e3], [5e3, 1e4]]
    for steps in (5, 20, 1000):
        printed = MatrixFading(wild, **{**PRINTED, "max_iterations": steps}, tau=0.9)
        plain = MultipleFading(wild)
        assert_same(
            printed.update(printed.start([0.0, 0.0], P0), 900.0),
            plain.update(plain.start([0.0, 0.0], P0), 900.0),
        )


@by_law
def test_outliers_of_every_size_leave_a_sound_belief(build):
    rng = np.random.default_rng(6)
    law = build(random_model(rng, 3, [1]))
    belief = law.start(np.zeros(3), 1.0)
    for size in 10.0 ** np.arange(-20.0, 24.0):
        belief = law.update(belief, size * rng.choice([-1.0, 1.0]))
        assert np.isfinite(belief.x).all()
        assert np.isfinite(belief.P).all()
        assert np.linalg.eigvalsh(belief.P)[0] >= -1e-9 * np.abs(belief.P).max()


by_filter = pytest.mark.parametrize("filter_of", [MultipleFading, MatrixFading])


@by_filter
def test_a_state_known_exactly_needs_no_factor_and_takes_none_from_others(filter_of):
    law = filter_of(LinearModel(np.eye(3), np.eye(3)[:2], 0.0, 1.0))
    belief = law.update(law.start(np.zeros(3), np.diag([0.0, 1.0, 0.0])), [100.0, 100.0])
    assert belief.fading[0] == belief.fading[2] == 1.0
    assert belief.fading[1] > 10.0
    assert belief.x[0] == belief.x[2] == 0.0


@by_filter
def test_where_factors_overflow_the_kalman_filter_remains(filter_of):
    law = filter_of(LinearModel(np.eye(2), [[1.0, 0.0]], 0.0, 1.0))
    belief = law.update(law.start([1.0, 2.0], 5e-324), 100.0)
    assert not belief.rejected
    assert np.array_equal(belief.fading, [1.0, 1.0])
    assert np.array_equal(belief.x, [1.0, 2.0])


@pytest.mark.parametrize("gate", [None, 1.0])
def test_a_search_that_cannot_be_solved_rejects_the_observation(gate):
    twice = LinearModel(np.eye(2), [[1.0, 0.0], [1.0, 0.0]], 0.0, 1e-6)
    law = MatrixFading(twice, gate=gate)
    assert law.update(law.start([0.0, 0.0], 1e20), [1.0, 1.0]).rejected


@pytest.mark.parametrize("H", [[[1.0, 1.0]], [[0.0, 0.0]], [[1.0, 0.0], [0.5, 2.0]]])
def test_fading_needs_one_state_to_a_row_of_H(H):
    model = LinearModel(np.eye(2), H, 0.0, 1.0)
    StateKalman(model)
    for law in (MultipleFading, MatrixFading):
        with pytest.raises(ValueError, match=r"^H must have exactly one non-zero in each row"):
            law(model)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("confidence", value) for value in (0.0, 1.0, math.nan, "95 %", True)),
        *(("tau", value) for value in (0.0, 1.0, math.nan, None)),
        *(("delta", value) for value in (0.0, -1.0, math.nan)),
        *(("max_iterations", value) for value in (0, 2.5, True)),
        *(("s_min", value) for value in (1.1, math.nan, None)),
        *(("s_max", value) for value in (0.9, math.nan, "1")),
        *(("gate", value) for value in (0.0, math.nan, "open")),
        *(("normalised", value) for value in ("no", 1, None)),
    ],
)
def test_a_law_names_the_setting_it_refuses(name, value):
    with pytest.raises(ValueError, match=rf"^{name} must"):
        MatrixFading(STUDY, **{name: value})
