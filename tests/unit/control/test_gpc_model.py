"""The model of changes: what it foresees, and what it says of a plant."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.control.gpc.model import ChangeModel
from thermoctl.control.prediction import predict
from thermoctl.model.arx import Arx


def random_model(rng):
    n, m, delay = int(rng.integers(1, 4)), int(rng.integers(1, 5)), int(rng.integers(1, 5))
    model = ChangeModel(n, m, delay)
    return model, rng.normal(0.0, 0.3, model.parameters)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.0, 1.0))
def test_what_it_foresees_is_what_an_arx_of_temperatures_does(seed, power):
    rng = np.random.default_rng(seed)
    model, theta = random_model(rng)
    a = np.concatenate(((1.0,), theta[: model.n - 1]))
    whole = np.convolve(a, (1.0, -1.0))[1:]  # A(q) (1 - q^-1) without its leading 1
    arx = Arx(model.n, model.m, model.delay)
    y, u = rng.normal(37.0, 1.0, 5), rng.uniform(0.0, 1.0, 10)
    foreseen = model.foreseen(theta, y[:-1] - y[1:], u, power, 8)
    now, moved = y[0], []
    for _ in range(8):
        u = np.concatenate(((power,), u))
        coefficients = np.concatenate((whole, theta[model.inputs]))
        y = np.concatenate(((predict(arx, coefficients, y, u) - theta[-1],), y))
        moved.append(y[0] - now)
    assert foreseen == pytest.approx(moved, rel=1e-9, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_the_first_block_foreseen_is_what_its_regressor_says(seed):
    rng = np.random.default_rng(seed)
    model, theta = random_model(rng)
    changes_k, u = rng.normal(0.0, 1.0, 4), rng.uniform(0.0, 1.0, 10)
    phi = model.regressor(changes_k, np.concatenate(((0.4,), u)))
    assert model.foreseen(theta, changes_k, u, 0.4, 1) == pytest.approx([float(phi @ theta)])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_what_is_under_way_is_what_comes_if_power_only_holds(seed):
    rng = np.random.default_rng(seed)
    model, theta = random_model(rng)
    poles = rng.uniform(0.0, 0.8, 2)[: model.n - 1]
    theta[: model.n - 1] = np.poly(poles)[1:] if len(poles) else ()
    theta[model.inputs] = rng.uniform(0.1, 1.0, model.m)
    changes_k, u, holding = rng.normal(0.0, 1.0, 4), rng.uniform(0.0, 1.0, 10), model.holding(theta)
    under_way_k = model.under_way_k(theta, changes_k, u - holding)
    foreseen = model.foreseen(theta, changes_k, u, holding, 200)
    assert foreseen[-1] == pytest.approx(under_way_k, abs=1e-6)


def test_holding_power_ends_every_change():
    model, theta = ChangeModel(3, 2, 1), np.array([-0.5, 0.1, 0.2, 0.1, 0.09])
    holding = model.holding(theta)
    moved = model.foreseen(theta, np.zeros(3), np.full(3, holding), holding, 40)
    assert holding == pytest.approx(0.3)
    assert moved == pytest.approx(np.zeros(40), abs=1e-12)


def test_gain_and_lag_are_those_of_the_ramp_a_step_ends_in():
    model, theta = ChangeModel(3, 3, 2), np.array([-0.7, 0.12, 0.05, 0.2, 0.1, 0.02])
    step_k = model.step_response(theta, 200)
    gain_k = model.gain_k(theta)
    assert step_k[-1] - step_k[-2] == pytest.approx(gain_k)
    # Without lag block j would stand at j gains.
    assert model.lag(theta) == pytest.approx(200.0 - step_k[-1] / gain_k)


@pytest.mark.parametrize(
    ("bad", "named"),
    [
        ({"n": 0}, "n must be an integer from 1 to 3, got 0"),
        ({"n": 4}, "n must be an integer from 1 to 3, got 4"),
        ({"m": True}, "m must be an integer from 1 to 12, got True"),
        ({"delay": 1.0}, r"delay must be an integer from 1 to 60, got 1\.0"),
    ],
)
def test_orders_are_refused_by_name(bad, named):
    with pytest.raises(ValueError, match=f"^{named}$"):
        ChangeModel(**({"n": 2, "m": 2, "delay": 1} | bad))
