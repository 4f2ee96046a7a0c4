import math

import pytest

from thermoctl.app.live.sentences import _SENTENCES, Mark, continued, sentence
from thermoctl.services.events import EVENTS
from thermoctl.signals import Event


def test_a_known_event_becomes_a_sentence_with_units() -> None:
    said = sentence(Event(3.0, "setpoint.changed", {"before_c": 25.0, "after_c": 37.5}))
    assert said.text == "Set point 37.50\u00a0°C, was 25.00\u00a0°C"
    assert (said.t_s, said.name, said.mark) == (3.0, "setpoint.changed", Mark.NONE)


def test_a_power_by_hand_is_told_in_per_cent() -> None:
    said = sentence(Event(3.0, "output.changed", {"before_power": 0.0, "after_power": 0.3}))
    assert said.text == "Power 30.0\u00a0% by hand, was 0.0\u00a0%"


def test_a_known_event_without_its_fields_is_still_a_sentence() -> None:
    for name in _SENTENCES:
        text = sentence(Event(0.0, name)).text
        assert text
        assert "{" not in text
        if name != "sim.disturbed":
            assert text[0].isupper()


def test_every_sentence_is_of_an_event_that_there_is() -> None:
    assert set(_SENTENCES) <= set(EVENTS)


def test_an_unknown_event_is_spelt_out_with_its_fields() -> None:
    said = sentence(Event(0.0, "pump.run_dry", {"flow_w": 3.0, "text": "no flow"}))
    assert said.text == "Pump run dry: flow_w 3\u00a0W, no flow"
    assert said.mark is Mark.NONE


def test_an_alarm_without_a_sentence_is_still_a_warning() -> None:
    assert sentence(Event(0.0, "alarm.rate", {"text": "too fast"})).mark is Mark.WARNING


@pytest.mark.parametrize(
    ("state", "mark"),
    [("run", Mark.NONE), ("ride", Mark.WARNING), ("safe", Mark.ALARM), ("latched", Mark.ALARM)],
)
def test_a_state_is_marked_by_how_bad_it_is(state: str, mark: Mark) -> None:
    fields = {"before": "run", "after": state, "why": "sensor.open"}
    assert sentence(Event(0.0, "state.changed", fields)).mark is mark


def test_no_field_can_bring_a_nan_or_a_template_into_a_sentence() -> None:
    for name in (*_SENTENCES, "never.seen"):
        fields = dict.fromkeys(("temperature_c", "after_c", "before_c", "late_s"), math.nan)
        said = sentence(Event(0.0, name, {**fields, "text": "{0} {x!r} %s"}))
        assert "nan" not in said.text.lower().replace("output nan", "")


def test_a_temperature_in_words_of_a_log_wears_the_sign_of_the_screen() -> None:
    said = sentence(Event(0.0, "request.refused", {"why": "expected 5 to 55 degC, got 60 degC."}))
    assert said.text == "Refused: expected 5 to 55\u00a0°C, got 60\u00a0°C."


def test_a_heater_in_doubt_wears_a_mark_and_a_faulty_one_an_alarm():
    marks = {
        name: sentence(Event(0.0, name, {"text": "cold"})).mark
        for name in ("heater.questioned", "heater.reversed", "heater.no_response")
    }
    assert list(marks.values()) == [Mark.WARNING, Mark.ALARM, Mark.ALARM]


def test_a_key_that_is_held_down_makes_one_change_from_where_it_began_to_where_it_ended() -> None:
    steps = [
        Event(0.3 * k, "setpoint.changed", {"before_c": 37.0 + k, "after_c": 38.0 + k})
        for k in range(30)
    ]
    said = sentence(steps[0])
    for event in steps[1:]:
        said = continued(said, event)
    assert said.text.replace("\u00a0", " ") == "Set point 67.00 °C, was 37.00 °C, in 30 steps"
    assert (said.t_s, said.name) == (steps[-1].t_s, "setpoint.changed")


def test_what_came_much_later_or_is_something_else_is_an_event_of_its_own() -> None:
    first = Event(0.0, "setpoint.changed", {"before_c": 37.0, "after_c": 38.0})
    later = Event(31.0, "setpoint.changed", {"before_c": 38.0, "after_c": 39.0})
    poured = Event(0.0, "sim.disturbed", {"text": "1 l"})
    assert continued(sentence(first), later) is None
    assert continued(sentence(first), poured) is None
    assert continued(sentence(poured), poured) is None
