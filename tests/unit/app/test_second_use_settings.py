"""Coolers in a configuration: laws that fit their actuators, outputs that differ."""

from pathlib import Path

import pytest

from thermoctl.app.compose import regulator_for, wiring_errors
from thermoctl.app.configuration.document import BadConfiguration
from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, simulate
from thermoctl.errors import ConfigError, Refused
from thermoctl.signals import ManualPower

CONFIG = Path(__file__).parents[3] / "config"
BOTH = {"kind": "adaptive", "action": "heat-cool"}


def changed(profile="heat-cool", **keys):
    """Return a profile with other keys in its loop."""
    document = load(CONFIG / f"{profile}.toml").in_force()
    document["loops"]["tank"] |= keys
    return document


def complaint(document):
    with pytest.raises(BadConfiguration) as caught:
        load(document)
    return str(caught.value)


def test_a_cooler_makes_the_range_signed_within_its_own_limit():
    table = load(changed()).loops["tank"]
    assert plan_for(table).limits.power_min == -1.0
    document = changed(cooler={"board": "daq", "power_max": 0.4, "changeover_s": 30.0})
    limits = plan_for(load(document).loops["tank"]).limits
    assert (limits.power_min, limits.changeover_s, limits.power_cools) == (-0.4, 30.0, False)


def test_heater_and_cooler_are_each_checked_by_the_most_power_they_get():
    document = changed(power_max=0.5, cooler={"board": "daq", "power_max": 0.4})
    check = plan_for(load(document).loops["tank"]).heater_check
    assert (check.of_heater.power_max, check.of_cooler.power_max) == (0.5, 0.4)


def test_a_lone_cooler_keeps_powers_from_0_to_1():
    limits = plan_for(load(changed("cool")).loops["tank"]).limits
    assert (limits.power_min, limits.power_cools) == (0.0, True)
    with pytest.raises(Refused, match="from 0 to 1"):
        regulator_for(load(changed("cool"))).request(ManualPower(-0.1))


@pytest.mark.parametrize(("keys", "text"), [
    ({"controller": "adaptive"}, "expected 'heat-cool' of a loop that has a cooler"),
    ({"controller": {"kind": "on-off", "action": "cool"}}, "on-off is for 'cool'"),
    ({"controller": "self-tuning-mv"}, "self-tuning-mv is for 'heat'"),
    ({"shadow": "pid"}, "pid is for 'heat'"),
])  # fmt: skip
def test_a_law_that_does_not_fit_a_heater_and_a_cooler_is_refused(keys, text):
    where = "shadow" if "shadow" in keys else "controller"
    told = complaint(changed(**keys))
    assert text in told
    assert f"loops.tank.{where}.action" in told


def test_heating_and_cooling_needs_a_cooler():
    assert "needs a table [loops.NAME.cooler]" in complaint(changed("aquarium", controller=BOTH))


def test_a_law_in_shadow_must_take_the_actuator_for_the_same():
    document = changed("cool", shadow={"kind": "pid", "action": "heat"})
    assert "loops.tank.shadow.action: expected 'cool' as in charge" in complaint(document)
    load(changed("cool", shadow={"kind": "pid", "action": "cool"}))


def test_heater_and_cooler_may_not_be_one_output():
    document = changed(cooler={"board": "daq", "output": "heater"})
    assert [(".".join(key), text) for key, text in wiring_errors(load(document))] == [
        (
            "loops.tank.cooler",
            "expected another output than the heater's, got 'heater' of 'daq' too",
        )
    ]


def test_two_loops_may_not_share_a_cooler():
    document = changed()
    document["loops"]["mash"] = document["loops"]["tank"] | {"actuator": {"board": "daq"}}
    told = [text for _, text in wiring_errors(load(document))]
    assert "expected one loop for output 'cooler' of 'daq', got tank, mash" in told


def test_the_dead_man_of_a_cooler_s_own_board_is_checked_too():
    document = changed(cooler={"board": "cold"})
    document["boards"]["cold"] = {"kind": "simulated", "cooler_w": 300.0, "dead_man_s": 0.5}
    assert [key for key, _ in wiring_errors(load(document))] == [("boards", "cold", "dead_man_s")]


def test_a_cooler_on_a_board_that_is_not_there_is_blamed():
    assert "loops.tank.cooler.board: no table [boards.doq]" in complaint(
        changed(cooler={"board": "doq"})
    )


@pytest.mark.parametrize("profile", ["cool", "heat-cool"])
def test_a_stand_in_for_a_real_board_cools_where_the_loop_does(profile):
    document = changed(profile)
    document["boards"]["daq"] = {"kind": "thermodaq", "port": "/dev/null"}
    for part in ("actuator", "cooler"):
        if part in document["loops"]["tank"]:
            document["loops"]["tank"][part]["output"] = "heater" if part == "actuator" else "cooler"
    cycles = list(simulate(load(document), 120.0))
    assert cycles[-1].truth["cooled_w"] > 0.0
    assert cycles[-1].truth["heater_w"] == 0.0
    assert cycles[-1].truth["true_temperature_c"] < cycles[0].truth["true_temperature_c"]


def test_a_stand_in_cannot_be_two_boards_around_one_tank():
    document = changed(cooler={"board": "cold"})
    for name in ("daq", "cold"):
        document["boards"][name] = {"kind": "thermodaq", "port": "/dev/null"}
    with pytest.raises(ConfigError, match="heater and its cooler on one board, got daq, cold"):
        bench_settings(load(document))
