"""What stands in for hardware on the bench."""

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, simulate, stand_ins
from thermoctl.errors import ConfigError
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import Mode
from thermoctl_drivers.simulated import SimulatedSettings


def configured(gain_k_per_s=0.0449, curve="lm335", period_s=1.0, **board):
    return load(
        {
            "boards": {"daq": {"kind": "thermodaq", "port": "/dev/nowhere"} | board},
            "loops": {
                "tank": {
                    "setpoint_c": 30.0,
                    "trip_above_c": 60.0,
                    "period_s": period_s,
                    "sensor": {"board": "daq", "curve": curve, "pull_up_ohm": 1000.0},
                    "actuator": {"board": "daq"},
                    "model": {"gain_k_per_s": gain_k_per_s},
                }
            },
        }
    )


@pytest.mark.parametrize("gain_k_per_s", [1e-4, 0.00717, 0.0449, 0.5, 2.0])
def test_a_tank_stands_in_that_heats_as_fast_as_the_model_says(gain_k_per_s):
    tank = stand_ins(configured(gain_k_per_s))["daq"]
    assert tank.heater_w / (4186.0 * tank.volume_l) == pytest.approx(gain_k_per_s, rel=0.4)


def test_a_tank_that_stands_in_has_the_litres_and_watts_that_are_told():
    content = configured().in_force()
    content["loops"]["tank"] |= {"heater_w": 2000.0, "volume_l": 20.0, "model": {}}
    tank = stand_ins(load(content))["daq"]
    assert (tank.volume_l, tank.heater_w) == (20.0, pytest.approx(2000.0))


@pytest.mark.parametrize("curve", ["lm335", "pt100", "ntc"])
@pytest.mark.slow
def test_a_tank_that_stands_in_is_held_whatever_sensor_the_real_one_has(curve):
    cycles = list(simulate(configured(curve=curve), 1200.0, seed=1))
    assert cycles[-1].truth["true_temperature_c"] == pytest.approx(30.0, abs=0.3)
    assert cycles[-1].step.mode is Mode.AUTO


def test_a_simulated_board_is_left_as_it_is_configured():
    settings = bench_settings()
    assert stand_ins(settings) == {}
    assert isinstance(settings.boards["daq"], SimulatedSettings)


def test_a_seed_makes_another_specimen_of_noise():
    runs = [
        [cycle.step.measurement.temperature_c for cycle in simulate(bench_settings(), 20.0, seed)]
        for seed in (1, 1, 2)
    ]
    assert runs[0] == runs[1] != runs[2]


def test_a_dead_man_that_ends_before_the_next_command_is_refused():
    with pytest.raises(ConfigError, match=r"dead_man_s: 2\.5 would end before the next command"):
        loop_for(configured(period_s=5.0), SimulatedClock(), print)
    assert loop_for(configured(period_s=5.0, dead_man_s=10.0), SimulatedClock(), print)
