"""Ramps and loads from the command line to the request, each word checked."""

import json

import pytest
from click.testing import CliRunner

from thermoctl.app.commands.control import _POWER, _RATE, _TEMPERATURE, load, mode
from thermoctl.app.daemon.clerk import Clerk
from thermoctl.services.control_protocol import Call, CallError, asking, parse
from thermoctl.signals import Load, SetPoint


class Asked:
    """A request the loop has granted."""

    settled, refusal = True, None


class Loop:
    """Takes requests and grants them."""

    def __init__(self):
        self.requests = []

    def ask(self, request, loop=None):
        self.requests.append(request)
        return Asked()


def granted(call, tmp_path):
    """Return the request that `call` became, and its reply."""
    loop = Loop()
    clerk = Clerk(loop, {}, {"tank": 1.0}, None, tmp_path, lambda: 0.0)
    return loop.requests, clerk.answer(call)()


@pytest.mark.parametrize(
    ("text", "k_per_min"),
    [("2/min", 2.0), ("2K/min", 2.0), ("0.5 K/min", 0.5), ("30/h", 0.5), ("30 °C/h", 0.5)],
)
def test_a_rate_has_its_unit(text, k_per_min):
    assert _RATE.convert(text, None, None) == pytest.approx(k_per_min)


@pytest.mark.parametrize("text", ["2", "2/s", "0/min", "-2/min", "fast", "1e9999/min", "2 W/min"])
def test_a_rate_without_a_unit_that_is_known_is_refused(text):
    with pytest.raises(Exception, match="expected a rate above 0"):
        _RATE.convert(text, None, None)


@pytest.mark.parametrize(
    ("text", "value_c"),
    [("40", 40.0), ("40C", 40.0), ("40 degC", 40.0), ("40°C", 40.0), ("104F", 40.0),
     ("104 degF", 40.0), ("313.15K", 40.0), ("-5c", -5.0), ("4e1 °C", 40.0)],
)  # fmt: skip
def test_a_temperature_may_wear_its_unit(text, value_c):
    assert _TEMPERATURE.convert(text, None, None)[1] == pytest.approx(value_c)


@pytest.mark.parametrize("text", ["", "C", "warm", "nan", "inf", "1e400", "40W", "40 ms", "40CF"])
def test_what_is_no_temperature_is_refused_with_how_one_is_written(text):
    with pytest.raises(Exception, match=r"expected a temperature in degC such as 65\.0, 65C"):
        _TEMPERATURE.convert(text, None, None)


def test_a_load_may_be_negative():
    assert _POWER.convert("-10%", None, None) == pytest.approx(-0.1)
    assert _POWER.convert("0.2", None, None) == 0.2
    with pytest.raises(Exception, match="expected a power"):
        _POWER.convert("120%", None, None)


def test_a_call_has_its_rate_and_its_duration():
    sent = asking(1, "set", {"value_c": 65.0, "rate_k_per_min": 2.0})
    assert parse(sent) == Call("set", 1, None, 65.0, 2.0)
    sent = asking(2, "set", {"value_c": 65.0, "rate_k_per_min": None})
    assert parse(sent) == Call("set", 2, None, 65.0, None)
    sent = asking(3, "load", {"power": 0.2, "duration_s": 600.0})
    assert parse(sent) == Call("load", 3, None, 0.2, 600.0)


@pytest.mark.parametrize(
    ("keys", "code"),
    [
        ({"do": "set", "value_c": 65.0, "rate_k_per_min": "2/min"}, "bad_value"),
        ({"do": "load", "power": 0.2}, "missing_key"),
        ({"do": "load", "power": 0.2, "duration_s": True}, "bad_value"),
        ({"do": "output", "power": 0.2, "duration_s": 1.0}, "unknown_key"),
    ],
)
def test_a_call_that_is_half_right_is_refused_as_such(keys, code):
    with pytest.raises(CallError) as refused:
        parse(json.dumps({"v": 1, **keys}).encode())
    assert refused.value.error["code"] == code


def test_a_ramp_becomes_a_set_point_with_a_rate(tmp_path):
    requests, reply = granted(Call("set", 1, None, 65.0, 2.0), tmp_path)
    assert requests == [SetPoint(65.0, 2.0)]
    assert reply == {"loop": "tank", "setpoint_c": 65.0, "rate_k_per_min": 2.0}
    requests, reply = granted(Call("set", 1, None, 65.0), tmp_path)
    assert requests == [SetPoint(65.0)]
    assert "rate_k_per_min" not in reply


def test_a_load_becomes_a_request(tmp_path):
    requests, reply = granted(Call("load", 1, None, 0.2, 600.0), tmp_path)
    assert requests == [Load(0.2, 600.0)]
    assert reply == {"loop": "tank", "power": 0.2, "duration_s": 600.0}


def test_a_load_above_none_that_does_not_say_how_long_is_refused_by_name():
    told = CliRunner().invoke(load, ["20%"])
    assert told.exit_code == 2
    assert "expected --for DURATION with a load of 20 %, got none" in told.output


def test_a_mode_that_is_none_is_refused_with_those_there_are():
    told = CliRunner().invoke(mode, ["of"])
    assert told.exit_code == 2
    assert "expected one of off, manual, auto, got 'of'" in told.output
