"""A loop that leads another in a configuration: everything that keeps it from that is told."""

from pathlib import Path

import pytest

from thermoctl.app.compose import loop_for, wiring_errors
from thermoctl.app.configuration.device_tables import CascadeTable
from thermoctl.app.configuration.document import BadConfiguration
from thermoctl.app.cycle_record import cycle_record
from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, simulate
from thermoctl.app.tuning.trial import alone
from thermoctl.control.adaptive.constants import Lags
from thermoctl.errors import ConfigError
from thermoctl.runtime.clock import SimulatedClock

CONFIG = Path(__file__).parents[3] / "config"


def cascade(**actuator):
    """Return the profile with other keys in the actuator of its outer loop."""
    document = load(CONFIG / "cascade.toml").in_force()
    document["loops"]["bath"]["actuator"] |= actuator
    return document


def complaints(document):
    with pytest.raises(BadConfiguration) as caught:
        load(document)
    return [line.removeprefix("configuration: loops.") for line in str(caught.value).splitlines()]


def test_an_actuator_with_a_loop_leads_it_and_drives_no_output():
    table = load(cascade()).loops["bath"]
    assert table.leads == CascadeTable(loop="block", low_c=20.0, high_c=80.0)
    assert table.outputs == ()
    assert plan_for(table).limits.applied_tolerance == 1.0


def test_what_is_in_force_loads_as_the_same_cascade():
    loaded = load(cascade())
    assert load(loaded.in_force()) == loaded


@pytest.mark.parametrize(("keys", "told"), [
    ({"loop": "blok"}, "bath.actuator.loop: no table [loops.blok] there; did you mean 'block'?"),
    ({"loop": "bath"}, "bath.actuator.loop: following bath leads back to bath"),
    ({"low_c": 10.0}, "bath.actuator.low_c: expected a set point of block, 20 to 80 and below its "
     "trip at 95, got 10"),
    ({"high_c": 90.0}, "bath.actuator.high_c: expected a set point of block, 20 to 80 and below "
     "its trip at 95, got 90"),
    ({"low_c": 80.0}, "bath.actuator.low_c: expected less than high_c (80), got 80"),
    ({"low_c": "cold"}, 'bath.actuator.low_c: expected a number, got "cold"'),
])  # fmt: skip
def test_a_cascade_that_cannot_be_is_refused_by_name(keys, told):
    assert complaints(cascade(**keys)) == [told]


def test_an_actuator_needs_a_board_or_a_loop():
    document = cascade()
    document["loops"]["bath"]["actuator"] = {"law": "linear"}
    assert complaints(document) == ["bath.actuator.board: expected a value, got none"]


def test_loops_do_not_lead_each_other_in_a_circle():
    document = cascade()
    document["loops"]["block"]["actuator"] = {"loop": "bath", "low_c": 20.0, "high_c": 50.0}
    assert complaints(document) == [
        "bath.actuator.loop: following block leads back to bath",
        "block.actuator.loop: following bath leads back to block",
    ]


def test_a_loop_has_one_master():
    document = cascade()
    document["loops"]["other"] = document["loops"]["bath"]
    assert complaints(document) == ["other.actuator.loop: block follows bath already"]


def test_an_outer_loop_has_no_cooler_and_its_law_heats():
    document = cascade()
    document["loops"]["bath"]["cooler"] = {"board": "daq"}
    document["loops"]["bath"]["controller"] = {"kind": "adaptive", "action": "heat-cool"}
    told = complaints(document)
    assert any("more power is a higher set point of the next" in line for line in told)
    assert "bath.cooler: expected none, for block is what acts in this loop" in told


def test_an_outer_loop_cannot_run_without_the_one_it_leads():
    settings = alone(load(cascade()), "bath")
    assert [key for key, _ in wiring_errors(settings)] == [("loops", "bath", "actuator", "loop")]
    with pytest.raises(ConfigError, match=r"no table \[loops.block\]"):
        loop_for(settings, SimulatedClock(), lambda cycle: None)


def test_a_cascade_on_real_boards_has_no_stand_in():
    document = cascade()
    document["boards"]["daq"] = {"kind": "thermodaq", "port": "/dev/null"}
    with pytest.raises(ConfigError, match="needs simulated boards"):
        bench_settings(load(document))


def test_an_adaptive_loop_that_follows_may_be_as_quick_as_a_block():
    document = cascade()
    document["loops"]["block"]["controller"] = {"kind": "adaptive"}
    del document["loops"]["block"]["jump_k"]
    loops = load(document).loops
    assert plan_for(loops["block"]).limits.jump_for(0.1, 0.0) == 25.0
    assert plan_for(loops["block"]).controller.lags == Lags(1.0, 60.0)
    assert plan_for(loops["bath"]).controller.lags == Lags()
    assert load(load(document).in_force()) == load(document)


def test_what_is_configured_of_a_follower_stays():
    document = cascade()
    lags = {"shortest_s": 2.0}
    document["loops"]["block"]["shadow"] = {"kind": "adaptive", "lags": lags}
    plan = plan_for(load(document).loops["block"])
    assert plan.shadow.lags == Lags(2.0)
    assert plan.limits.jump_for(0.1, 0.0) == 12.0


@pytest.fixture(scope="module")
def ran():
    """The last cycle of each loop of the profile after some minutes."""
    return {cycle.loop: cycle for cycle in simulate(load(CONFIG / "cascade.toml"), 400.0, 1)}


def test_each_loop_is_told_the_true_temperature_of_what_its_own_sensor_is_in(ran):
    block, bath = cycle_record(ran["block"]), cycle_record(ran["bath"])
    assert block["true_temperature_c"] == ran["bath"].truth["element_c"]
    assert block["true_temperature_c"] == pytest.approx(block["temperature_c"], abs=0.5)
    assert bath["true_temperature_c"] == pytest.approx(bath["temperature_c"], abs=0.5)
    assert block["true_temperature_c"] > bath["true_temperature_c"] + 5.0


def test_what_can_be_held_is_told_of_the_outer_loop_alone(ran):
    told = {name: cycle_record(cycle)["feasible"] for name, cycle in ran.items()}
    assert told["bath"]["highest_c"] is not None
    assert set(told["block"].values()) == {None}
