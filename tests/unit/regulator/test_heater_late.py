"""A lag that has grown while nobody looked: heat that arrives after the power has gone."""

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.regulator.heater.evidence import SOUND, weigh
from thermoctl.regulator.heater.question import Answer, contrast, of_known
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.signals import Measurement

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

GAIN, LOSS = 0.04, 0.008
HEATER = Gain(GAIN, 0.001, 1)
SD_K = 0.01
LOOP = {
    "setpoint_c": 37.5,
    "trip_above_c": 60.0,
    "mode": "auto",
    "controller": "adaptive",
    "model": {"structure": "known-gain", "gain_k_per_s": GAIN},
}


class Pocket:
    """Water with an element, and a sensor whose pocket dries out and makes it slow."""

    def __init__(self, seed: int) -> None:
        settings = load({"boards": {"b": {"kind": "null"}}, "loops": {"tank": LOOP}})
        self.regulator = regulator_for(settings)
        self.rng = np.random.default_rng(seed)
        self.t_s = self.element = 0.0
        self.water_c = self.wet_c = self.sensor_c = 30.0
        self.pole_s, self.works = 6.0, 1.0
        self.told: list[tuple[float, str]] = []
        self.states: set[str] = set()

    def run(self, seconds: int) -> "Pocket":
        for _ in range(seconds):
            reading_c = self.sensor_c + 0.02 * self.rng.standard_normal()
            step = self.regulator.step(Measurement(self.t_s, reading_c))
            self.told += [
                (self.t_s, each.name) for each in step.events if each.name.startswith("heater.")
            ]
            self.states.add(step.state.value)
            self.element += (step.command.power - self.element) / 9.0
            loss = LOSS * (self.water_c - 22.0) / 15.5
            self.water_c += self.works * GAIN * self.element - loss
            self.wet_c += (self.water_c - self.wet_c) / 5.0
            self.sensor_c += (self.wet_c - self.sensor_c) / self.pole_s
            self.t_s += 1.0
        return self


@pytest.mark.parametrize("seed", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3))])
def test_cold_water_on_a_lag_that_has_grown_condemns_no_heater(seed: int) -> None:
    pocket = Pocket(seed).run(1500)
    pocket.pole_s = 62.0
    pocket.run(900)
    pocket.water_c -= 3.0
    pocket.run(1500)
    assert pocket.states == {"run"}, pocket.told
    assert [name for _, name in pocket.told if name == "heater.questioned"], "it has to be asked"


def test_wires_that_are_swapped_at_rest_are_told_of_although_a_lag_may_have_grown() -> None:
    pocket = Pocket(1).run(2400)
    pocket.works = -1.0
    pocket.run(400)
    reversed_s = [t_s - 2400.0 for t_s, name in pocket.told if name == "heater.reversed"]
    assert reversed_s
    assert reversed_s[0] < 160.0
    assert "latched" in pocket.states


def rows_of(lag_s: float, gain: float, *, seed: int = 1) -> list[Seen]:
    """Return half a minute of power and a minute without it, as a heater behind `lag_s` shows."""
    rng = np.random.default_rng(seed)
    lags = [*LAGS_S, lag_s]
    first, second, heat = (np.zeros(len(lags)) for _ in range(3))
    rows = []
    for second_s in range(100):
        power = 1.0 if second_s < 32 else 0.0
        first += (power - first) / np.array(lags) * 2.0
        second += (first - second) / np.array(lags) * 2.0
        heat += second
        if second_s % 4 == 3:
            reading_c = 37.0 - LOSS * second_s + gain * heat[-1] + SD_K * rng.standard_normal()
            rows.append(Seen(float(second_s), float(reading_c), tuple(heat[:-1])))
    return rows


def answer_of(lag_s: float, gain: float) -> Answer:
    found = contrast(rows_of(lag_s, gain), SD_K)
    assert found is not None
    return of_known(found, HEATER)[0]


@pytest.mark.parametrize("lag_s", [60.0, 70.0, 80.0])
def test_heat_that_arrives_after_the_cut_is_late_and_not_that_of_a_heater_that_cools(
    lag_s: float,
) -> None:
    assert answer_of(lag_s, GAIN) is Answer.LATE


@pytest.mark.parametrize("lag_s", [5.0, 9.0, 20.0])
def test_a_heater_that_cools_is_none_that_is_late(lag_s: float) -> None:
    assert answer_of(lag_s, -GAIN) is Answer.COOLS


@pytest.mark.parametrize("lag_s", [5.0, 9.0, 20.0])
def test_an_answer_in_time_is_none_that_is_late(lag_s: float) -> None:
    assert answer_of(lag_s, GAIN) is Answer.HEATS


def test_what_is_late_is_believed_once_the_readings_before_do_not_deny_it() -> None:
    for crept, late in ((False, False), (True, False), (False, True), (True, True)):
        assert weigh(Answer.LATE, -0.1, crept=crept, late=late) is Answer.OPEN
        assert weigh(Answer.LATE, 0.1, crept=crept, late=late) is Answer.HEATS
    assert weigh(Answer.COOLS, 0.9 * SOUND, crept=False, late=False) is Answer.COOLS
