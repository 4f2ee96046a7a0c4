"""The plant in words: units, errors, and dashes with a reason."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from thermoctl.insight.rows import rows
from thermoctl.quantities import Uncertain
from thermoctl.signals import PlantBelief

PLANT = PlantBelief(
    *(0.044, 0.001, 0.009, 0.0005, 0.2, 0.01, 18.0, 14.0, 21.0, 37.5, 0.02),
    learning=False,
    jumped=False,
)
GAIN = Uncertain(0.044, 0.001)


def named(*args, **more):
    return {row.name: row for row in rows(*args, **more)}


def test_a_gain_is_told_per_minute_with_two_standard_deviations():
    row = named(PLANT, GAIN)["gain"]
    assert (row.value, row.error) == pytest.approx((2.64, 0.12))
    assert row.text == "2.64 ± 0.12 K/min"


def test_the_lag_has_quantiles_in_place_of_an_error():
    row = named(PLANT, GAIN)["lag"]
    assert (row.value, row.low, row.high, row.error) == (18.0, 14.0, 21.0, None)
    assert row.text == "18 s, between 14 and 21"


def test_a_heater_that_is_known_makes_litres_and_watts_of_it():
    told = named(PLANT, GAIN, heater_w=1500.0)
    assert told["volume"].value == pytest.approx(1500.0 / 0.044 / 4181.0 / 0.995)
    assert told["volume"].error / told["volume"].value == pytest.approx(2.0 * 0.001 / 0.044)
    assert (told["loss_w"].value, told["loss_w"].error) == pytest.approx((300.0, 30.0))


def test_the_slope_of_the_loss_is_watts_per_kelvin():
    row = named(PLANT, GAIN, Uncertain(3e-4, 3e-5), 1500.0)["loss_w_per_k"]
    assert row.value == pytest.approx(1500.0 / 0.044 * 3e-4)
    assert row.error / row.value == pytest.approx(2.0 * math.hypot(0.1, 0.001 / 0.044))


def test_without_a_heater_what_needs_one_is_a_dash_with_the_reason():
    for name in ("volume", "loss_w", "loss_w_per_k"):
        row = named(PLANT, GAIN)[name]
        assert (row.value, row.error) == (None, None)
        assert row.text == "– heater_w is not configured"


def test_a_loss_of_nothing_keeps_its_error():
    row = named(replace(PLANT, holding_power=0.0), GAIN, heater_w=1500.0)["loss_w"]
    assert (row.value, row.error) == (0.0, 30.0)


def test_what_is_no_number_is_not_known():
    row = named(PLANT, Uncertain(math.nan, 0.1))["gain"]
    assert row.value is None
    assert row.text.startswith("–")


@pytest.mark.parametrize(
    ("vague", "names"),
    [
        ({"gain": Uncertain(0.01, 0.005)}, ["gain", "volume", "loss_w", "loss_w_per_k"]),
        ({"holding_power_sd": 0.3}, ["loss", "holding_power", "loss_w"]),
        ({"lag_low_s": 3.0, "lag_high_s": 139.0}, ["lag"]),
    ],
)
def test_what_has_not_been_learnt_yet_is_a_dash_with_the_reason(vague, names):
    gain = vague.pop("gain", GAIN)
    told = named(replace(PLANT, **vague), gain, Uncertain(3e-4, 3e-5), heater_w=1500.0)
    assert {name for name, row in told.items() if row.value is None} == set(names)
    assert {told[name].text for name in names} == {"– not known yet"}
