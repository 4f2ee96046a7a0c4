"""Whatever a sensor, an actuator and an operator do, `Regulator.step` answers without a warning."""

import math
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.errors import Refused
from thermoctl.signals import (
    Acknowledge,
    ChooseController,
    Load,
    ManualPower,
    Measurement,
    Mode,
    Quality,
    SetPoint,
)

LAWS = ("adaptive", "pid", "on-off", "self-tuning-gpc", "self-tuning-mv")
SENSOR_C = st.floats(-60.0, 130.0)
"""All that an LM335 and its converter can show."""
REQUESTS = st.one_of(
    st.sampled_from([Mode.OFF, Mode.MANUAL, Mode.AUTO]),
    st.builds(SetPoint, st.floats(5.0, 90.0), st.none() | st.floats(0.1, 10.0)),
    st.builds(ManualPower, st.floats(0.0, 1.0)),
    st.builds(Load, st.floats(-1.0, 1.0), st.floats(1.0, 5000.0)),
    st.just(Acknowledge()),
    st.sampled_from(LAWS).map(ChooseController),
)


def episodes(gain):
    """Return what happens for some time, to a plant of that gain or to its readings."""
    return st.fixed_dictionaries(
        {
            "samples": st.integers(1, 200),
            "interval_s": st.sampled_from([0.2, 1.0, 1.0, 1.0, 7.0, 59.0, 4000.0, 1e7, 0.0, -5.0]),
            "jump_k": st.just(0.0) | st.floats(-80.0, 80.0),
            "stuck": st.none() | st.floats(0.0, 1.0),
            "reading": st.sampled_from(["true", "true", "true", "frozen", "missing", "short"])
            | SENSOR_C,
            "applied": st.sampled_from(["command", "command", "nothing told", "nan", "full"]),
            "gain": st.just(gain) | st.floats(-3.0, 3.0),
            "request": st.none() | REQUESTS,
        }
    )


class Plant:
    """A lump of anything, warmed by a heater or cooled by it, and a sensor that clips."""

    def __init__(self, regulator):
        self.regulator, self.true_c, self.shown_c, self.t_s = regulator, 20.0, 20.0, 0.0
        self.power = 0.0

    def live(self, what):
        """Go through an episode."""
        if what["request"] is not None:
            with suppress(Refused):
                self.regulator.request(what["request"])
        self.true_c += what["jump_k"]
        for _ in range(what["samples"]):
            self._sample(what)

    def _sample(self, what):
        given_power = self.power if what["stuck"] is None else what["stuck"]
        span_s = min(max(what["interval_s"], 0.0), 300.0)
        rise_k = span_s * (what["gain"] * given_power - 2e-3 * (self.true_c - 20.0))
        self.true_c = min(max(self.true_c + rise_k, -200.0), 2000.0)
        self.t_s += what["interval_s"]
        step = self.regulator.step(self._measured(what["reading"]))
        assert [event for event in step.events if event.name.endswith(".failed")] == []
        assert math.isfinite(step.command.power)
        assert -1.0 <= step.command.power <= 1.0
        self.power = step.command.power
        told = {"command": self.power, "nan": math.nan, "full": 1.0}.get(what["applied"])
        if told is not None:
            self.regulator.applied(told)

    def _measured(self, reading):
        if reading == "missing":
            return Measurement(self.t_s, math.nan, Quality.MISSING)
        if reading == "short":
            return Measurement(self.t_s, self.shown_c, Quality.SHORT)
        if reading == "true":
            self.shown_c = min(max(self.true_c, -60.0), 130.0)
        elif reading != "frozen":
            self.shown_c = reading
        return Measurement(self.t_s, self.shown_c)


def lived(table, gain, story):
    """Let a regulator of this table live through the story."""
    loop = {"mode": "auto", "trip_above_c": 95.0, "setpoint_c": 40.0, **table}
    plant = Plant(regulator_for(load({"loops": {"tank": loop}})))
    for what in story:
        plant.live(what)


STORIES = st.sampled_from([1e-4, 0.04, 0.5]).flatmap(
    lambda gain: st.tuples(st.just(gain), st.lists(episodes(gain), min_size=1, max_size=12))
)
TABLES = st.fixed_dictionaries(
    {"controller": st.sampled_from(LAWS), "period_s": st.sampled_from([1.0, 1.0, 0.2, 10.0])},
    optional={"shadow": st.sampled_from(LAWS), "setpoint_rate_k_per_min": st.just(1.0)},
)


@pytest.mark.slow
@settings(
    max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
@given(TABLES, STORIES)
def test_no_story_makes_a_regulator_raise_or_warn(table, story):
    if table.get("shadow") == table["controller"]:
        table = {key: value for key, value in table.items() if key != "shadow"}
    lived(table, *story)
