"""A kettle that boils below its set point, and what only looks like one."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.regulator.balance.wanted import Wanted
from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.ceiling import FELL_K, FOLLOWED_S, Ceiling
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.signals import Measurement, Mode

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

GAIN, LOSS = 0.04, 0.008
HEATER = Gain(GAIN, 0.001, 2)
LOOP = {
    "setpoint_c": 100.0,
    "trip_above_c": 110.0,
    "mode": "auto",
    "controller": "adaptive",
    "model": {"structure": "known-gain", "gain_k_per_s": GAIN},
}


class Kettle:
    """Water that boils at 98 degC, an element that stores heat, and a sensor behind it."""

    def __init__(self, seed: int, *, start_c: float = 80.0) -> None:
        settings = load({"boards": {"b": {"kind": "null"}}, "loops": {"tank": LOOP}})
        self.regulator = regulator_for(settings)
        self.rng = np.random.default_rng(seed)
        self.t_s = self.element = 0.0
        self.water_c = self.sensor_c = start_c
        self.works = 1.0
        self.shows: Callable[[float], float] = lambda reading_c: reading_c
        self.events: list[tuple[float, str, str]] = []
        self.states: set[str] = set()
        self.powers: list[float] = []

    def run(self, seconds: int) -> "Kettle":
        for _ in range(seconds):
            reading_c = self.shows(self.sensor_c) + 0.02 * self.rng.standard_normal()
            step = self.regulator.step(Measurement(self.t_s, reading_c))
            self.events += [
                (self.t_s, each.name, str(each.fields.get("text"))) for each in step.events
            ]
            self.states.add(step.state.value)
            self.powers.append(step.command.power)
            self.element += (self.works * step.command.power - self.element) / 10.0
            self.water_c = min(self.water_c + GAIN * self.element - LOSS, 98.0)
            self.sensor_c += (self.water_c - self.sensor_c) / 10.0
            self.t_s += 1.0
        return self

    def told(self, name: str) -> list[float]:
        return [t_s for t_s, each, _ in self.events if each == name]


@pytest.mark.parametrize("seed", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3))])
def test_a_kettle_that_boils_is_not_latched_but_told_that_it_gets_no_warmer(seed: int) -> None:
    kettle = Kettle(seed).run(3000)
    assert "latched" not in kettle.states
    assert len(kettle.told("heater.no_response")) <= 1
    (unreachable,) = [text for _, name, text in kettle.events if name == "setpoint.unreachable"]
    assert "at most 98.0 +-" in unreachable
    assert kettle.told("setpoint.unreachable")[0] < 1400.0
    assert len(kettle.told("heater.questioned")) <= 2
    assert min(kettle.powers[-1200:]) > 0.9, "it goes on boiling, and is asked no more"


def test_a_heater_that_dies_under_a_boiling_kettle_is_latched() -> None:
    kettle = Kettle(1).run(2000)
    assert math.isfinite(kettle.regulator._watch.ceiling_c)  # type: ignore[union-attr]
    kettle.works = 0.0
    kettle.run(900)
    assert "latched" in kettle.states
    assert [t_s for t_s in kettle.told("heater.no_response") if t_s > 2000.0]


@pytest.mark.parametrize("noise_k", [0.0, 0.03])
def test_a_reading_that_stands_still_at_98_degrees_is_latched_as_soon_as_ever(
    noise_k: float,
) -> None:
    kettle = Kettle(1).run(500)
    rng = np.random.default_rng(5)
    state = [0.0]

    def stands(_: float) -> float:
        state[0] = 0.98 * state[0] + 0.2 * noise_k * rng.standard_normal()
        return 90.0 + state[0]

    kettle.shows, kettle.sensor_c = stands, 90.0
    kettle.run(600)
    assert "latched" in kettle.states
    assert not math.isfinite(kettle.regulator._watch.ceiling_c)  # type: ignore[union-attr]


def rows_of(readings_c: list[float], powers: list[float]) -> list[Seen]:
    """Return blocks of four seconds of `powers` behind the lag of the heater."""
    rows, heat, first, second = [], 0.0, powers[0], powers[0]
    for place, (reading_c, power) in enumerate(zip(readings_c, powers, strict=True)):
        first += (power - first) * 0.33
        second += (first - second) * 0.33
        heat += 4.0 * second
        rows.append(Seen(4.0 * place, reading_c, (heat,) * len(LAGS_S)))
    return rows


STOOD, OFF, BACK = 20, 20, 20
POWERS = [1.0] * STOOD + [0.0] * OFF + [1.0] * BACK
CUT_S = 4.0 * STOOD


def found(readings_c: list[float], powers: list[float] = POWERS, end: int | None = None) -> Ceiling:
    """Return what has been made of readings around a cut."""
    ceiling, rows = Ceiling(), rows_of(readings_c, powers)
    for place, now in enumerate(rows[:end]):
        ceiling.holds(Block(4.0, powers[place], now.reading_c, 0.005))
        if now.t_s == CUT_S:
            ceiling.follow(rows[: place + 1], HEATER, CUT_S)
        ceiling.found(rows[: place + 1], HEATER, now, 0.005)
    return ceiling


def dip(depth_k: float) -> list[float]:
    """Return a reading that stands, falls when the power is cut and comes back with it."""
    fall = list(np.linspace(98.0, 98.0 - depth_k, OFF))
    rise = [min(98.0, 98.0 - depth_k + 0.16 * max(k - 3, 0)) for k in range(BACK)]
    return [98.0] * STOOD + fall + rise


def test_a_reading_that_fell_without_power_and_came_back_with_it_has_found_a_ceiling() -> None:
    ceiling = found(dip(0.4))
    assert ceiling.known
    assert ceiling.level_c == pytest.approx(98.0, abs=0.01)


def test_a_fall_that_noise_may_be_is_none() -> None:
    assert not found(dip(0.8 * FELL_K)).known


def test_a_reading_that_falls_and_stays_there_has_found_nothing() -> None:
    assert not found(dip(0.4), end=STOOD + OFF + 3).known


def test_a_reading_that_comes_back_without_power_has_found_nothing() -> None:
    assert not found(dip(0.4), [1.0] * STOOD + [0.0] * (OFF + BACK)).known


def test_what_stands_under_less_than_the_most_power_has_found_no_ceiling() -> None:
    powers = [1.0] * 3 + [0.3] * (STOOD - 3) + [0.0] * OFF + [1.0] * BACK
    assert not found(dip(0.4), powers).known


def test_what_comes_back_an_hour_later_comes_back_for_another_reason() -> None:
    readings_c, low = dip(0.4), STOOD + OFF
    for wait_s, is_known in ((0.1 * FOLLOWED_S, True), (FOLLOWED_S, False)):
        late = round(wait_s / 4.0)
        waited_c = readings_c[:low] + [97.6] * late + readings_c[low:]
        assert found(waited_c, POWERS[:low] + [0.0] * late + POWERS[low:]).known is is_known


def test_at_the_ceiling_power_shows_nothing_and_below_it_everything_is_expected() -> None:
    ceiling = found(dip(0.4))
    assert ceiling.holds(Block(4.0, 1.0, 97.9, 0.005))
    assert not ceiling.holds(Block(4.0, 0.5, 97.9, 0.005)), "with less power it may be lower"
    assert not ceiling.holds(Block(4.0, 1.0, 97.5, 0.005))
    assert not ceiling.holds(Block(4.0, 1.0, math.nan, 0.005))
    assert ceiling.known


def test_a_reading_above_the_ceiling_shows_that_there_was_none() -> None:
    ceiling = found(dip(0.4))
    assert not ceiling.holds(Block(4.0, 1.0, 98.5, 0.005))
    assert not ceiling.known


def test_a_set_point_beyond_the_ceiling_counts_on_the_side_to_which_power_drives() -> None:
    assert Wanted(100.0, 1.0, Mode.AUTO, ceiling_c=98.0).beyond_ceiling
    assert not Wanted(98.3, 1.0, Mode.AUTO, ceiling_c=98.0).beyond_ceiling
    assert not Wanted(100.0, 1.0, Mode.AUTO).beyond_ceiling
    assert Wanted(2.0, 1.0, Mode.AUTO, power_cools=True, ceiling_c=4.0).beyond_ceiling
    assert not Wanted(5.0, 1.0, Mode.AUTO, power_cools=True, ceiling_c=4.0).beyond_ceiling
