"""The structures of the plant's model: signs, order, delay, centre and scale."""

import math

import numpy as np
import pytest

from thermoctl.model.arx import Arx, KnownGain

Y_PAST = np.array([40.0, 39.0, 37.0])
U_PAST = np.array([0.5, 0.25, 0.125, 0.75])


def test_regressor_has_negated_outputs_first_then_inputs_newest_first():
    phi = Arx(n=2, m=3).regressor(Y_PAST, U_PAST)
    assert phi.tolist() == [-40.0, -39.0, 0.5, 0.25, 0.125]


def test_a_delay_skips_the_inputs_that_have_no_effect_yet():
    assert Arx(n=1, m=2, delay=3).regressor(Y_PAST, U_PAST).tolist() == [-40.0, 0.125, 0.75]


def test_an_autoregression_has_no_inputs_and_needs_none():
    structure = Arx(n=3, m=0, delay=5)
    assert structure.regressor(Y_PAST, np.empty(0)).tolist() == [-40.0, -39.0, -37.0]
    assert structure.u_memory == 0


def test_centre_and_scales_apply_to_regressor_and_target_alike():
    structure = Arx(n=1, m=1, y_centre_c=20.0, y_scale_k=10.0, u_scale=0.5)
    assert structure.regressor(Y_PAST, U_PAST).tolist() == [-2.0, 1.0]
    assert structure.target(35.0, U_PAST) == 1.5
    assert structure.temperature(1.5, U_PAST) == 35.0


@pytest.mark.parametrize(
    "structure", [Arx(2, 2), Arx(2, 2, 3, 25.0, 10.0, 0.2), Arx(1, 0), KnownGain(0.0449)]
)
def test_temperature_undoes_target_and_the_memory_is_all_that_is_used(structure):
    assert structure.temperature(structure.target(37.5, U_PAST), U_PAST) == pytest.approx(37.5)
    whole = structure.regressor(Y_PAST, U_PAST)
    cut = structure.regressor(Y_PAST[: structure.y_memory], U_PAST[: structure.u_memory])
    assert np.array_equal(whole, cut)
    assert whole.shape == (structure.parameters,)


def test_a_plant_simulated_by_its_difference_equation_is_explained_without_error():
    structure = Arx(n=2, m=2, delay=2, y_centre_c=20.0, y_scale_k=4.0, u_scale=2.0)
    a, b = (-1.5, 0.56), (0.3, 0.1)
    y, u = [0.0, 0.0], np.random.default_rng(0).uniform(size=40)
    for t in range(2, 40):
        scaled = u / 2.0
        inputs = b[0] * scaled[t - 2] + (b[1] * scaled[t - 3] if t > 2 else 0.0)
        y.append(-a[0] * y[t - 1] - a[1] * y[t - 2] + inputs)
    celsius = 20.0 + 4.0 * np.array(y)
    for t in range(4, 40):
        y_past, u_past = celsius[:t][::-1], u[:t][::-1]
        explained = structure.regressor(y_past, u_past) @ np.array([*a, *b])
        assert structure.temperature(explained, u_past) == pytest.approx(celsius[t], abs=1e-12)


def test_a_known_gain_leaves_only_the_pole_to_be_learned():
    structure = KnownGain(0.04)
    assert structure.regressor(Y_PAST, U_PAST).tolist() == [40.0]
    assert structure.target(41.0, U_PAST) == pytest.approx(41.0 - 0.02)


def test_an_unknown_past_makes_the_regressor_unknown():
    gap = np.array([math.nan, 39.0, 37.0])
    assert np.isnan(Arx(2, 1).regressor(gap, U_PAST)).tolist() == [True, False, False]
    assert math.isnan(KnownGain(0.04).target(41.0, np.array([math.nan])))


@pytest.mark.parametrize(
    ("name", "build"),
    [
        *(("n", lambda v=v: Arx(v, 1)) for v in (-1, 1.0, True)),
        *(("m", lambda v=v: Arx(1, v)) for v in (-1, 1.0, True)),
        ("n and m", lambda: Arx(0, 0)),
        *(("delay", lambda v=v: Arx(1, 1, v)) for v in (0, 1.5)),
        *(("y_centre_c", lambda v=v: Arx(1, 1, y_centre_c=v)) for v in (math.nan, math.inf)),
        *(("y_scale_k", lambda v=v: Arx(1, 1, y_scale_k=v)) for v in (0.0, -1.0, math.nan)),
        *(("u_scale", lambda v=v: Arx(1, 1, u_scale=v)) for v in (0.0, -1.0, math.inf)),
        *(("b_k", lambda v=v: KnownGain(v)) for v in (0.0, -0.04, math.nan, math.inf)),
    ],
)
def test_a_structure_names_the_argument_that_is_wrong(name, build):
    with pytest.raises(ValueError, match=name):
        build()
