import math
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.app.live.look import Colour, Look, Role, segments
from thermoctl.app.live.model import Facts, LiveModel, View
from thermoctl.app.live.render import render
from thermoctl.insight import Gate, Insight, Performance, Row
from thermoctl.signals import (
    Alarm,
    Beliefs,
    Command,
    Cycle,
    Estimate,
    Event,
    Feasible,
    Measurement,
    Mode,
    Quality,
    State,
    Step,
)

MakeCycle = Callable[..., Cycle]
PLAIN = Look(Colour.NONE)
SIZES = [(80, 24), (100, 33), (200, 60), (83, 25), (79, 24), (20, 3), (1, 1)]
LOOKS = [Look(colour, utf8) for colour in Colour for utf8 in (True, False)]

anything = st.floats(allow_nan=True, allow_infinity=True)
likely = st.floats(-50.0, 150.0)
maybe = st.none() | st.floats(-2.0, 2.0) | anything
words = st.text(max_size=120)
names = st.sampled_from(["loop.started", "plant.changed", "trip.over_temperature"]) | words
fields = st.dictionaries(st.sampled_from(["text", "after_c", "why", "late_s"]), anything | words)
alarms = st.builds(
    Alarm,
    code=words | st.just("setpoint.unreachable"),
    fault=st.none(),
    priority=st.integers(1, 3),
    since_s=anything,
    text=words,
    active=st.booleans(),
    latched=st.booleans(),
    acknowledged=st.booleans(),
)
cycles = st.builds(
    lambda value_c, quality, mode, state, set_c, power, theta, believed, rows, said, tick, at: (
        Cycle(
            "tank",
            Step(
                0.0,
                Measurement(0.0, value_c, quality),
                mode,
                state,
                set_c,
                Command(0.0, 3.0, "off"),
                "self-tuning-mv",
                Estimate(np.ones(theta), np.eye(theta), value_c, power, power),
                believed,
                tuple(rows),
                tuple(said),
                feasible=at,
            ),
            power,
            tick,
        )
    ),
    likely | anything,
    st.sampled_from(Quality),
    st.sampled_from(Mode),
    st.sampled_from(State),
    likely | anything,
    st.floats(0.0, 1.0) | anything,
    st.integers(0, 3),
    st.builds(Beliefs, maybe, maybe, maybe, maybe, maybe),
    st.lists(alarms, max_size=3),
    st.lists(st.builds(Event, st.floats(-10.0, 1e4) | anything, names, fields), max_size=4),
    anything,
    st.builds(Feasible, *[likely | anything] * 6),
)


row_names = ("gain", "loss", "loss_w", "loss_w_per_k", "holding_power", "lag", "noise", "volume")
insights = st.none() | st.builds(
    Insight,
    anything,
    st.sampled_from(Gate),
    st.lists(
        st.builds(Row, st.sampled_from(row_names), words, maybe, maybe, words, words, maybe, maybe),
        max_size=4,
    ).map(tuple),
    performance=st.builds(Performance, words, ratio=maybe),
)


def view_of(
    run: list[Cycle],
    interval_s: float,
    later_s: float,
    name: str = "tank",
    insight: Insight | None = None,
) -> View:
    facts = Facts(name, 1.0, 5.0, 60.0, datetime(2026, 3, 1, 23, 50), speed=None)
    model = LiveModel(facts)
    for k, cycle in enumerate(run):
        step = replace(cycle.step, t_s=k * interval_s)
        model.feed(replace(cycle, loop=name, step=step), insight)
    return model.view(max(0, len(run) - 1) * interval_s + later_s)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(cycles, max_size=8),
    st.sampled_from([0.1, 1.0, 60.0, 1e5, 1e8]),
    st.sampled_from([0.0, 0.5, 100.0, 1e7]),
    st.sampled_from(LOOKS),
    st.text(min_size=1, max_size=100),
    insights,
)
@pytest.mark.slow
def test_every_row_fits_whatever_comes(
    run: list[Cycle],
    interval_s: float,
    later_s: float,
    look: Look,
    name: str,
    insight: Insight | None,
) -> None:
    view = view_of(run, interval_s, later_s, name, insight)
    for width, height in SIZES:
        rows = render(view, width, height, look)
        assert len(rows) == height
        for row in rows:
            assert row.cell_len == width
            assert "\n" not in row.plain
            assert "\x1b" not in row.plain
            assert look.utf8 or row.plain.isascii()


numeric = cycles.map(
    lambda cycle: replace(cycle, step=replace(cycle.step, alarms=(), events=(), controller="law"))
)


@settings(max_examples=60, deadline=None)
@given(st.lists(numeric, max_size=8), st.sampled_from(SIZES[:3]))
def test_nan_and_infinity_never_reach_the_screen(run: list[Cycle], size: tuple[int, int]) -> None:
    picture = "\n".join(row.plain.lower() for row in render(view_of(run, 1.0, 0.5), *size, PLAIN))
    assert "nan" not in picture
    assert "inf" not in picture.replace("innov", "")
    assert "none" not in picture


def texts(view: View, width: int = 100, height: int = 30, look: Look = PLAIN) -> list[str]:
    return [row.plain.replace("\u00a0", " ") for row in render(view, width, height, look)]


@pytest.mark.parametrize("size", [(80, 24), (100, 30)])
def test_the_first_rows_say_who_in_which_state_and_what_now(
    sixty: LiveModel, size: tuple[int, int]
) -> None:
    state, values = texts(sixty.view(59.4), *size)[:2]
    for said in ("tank", "SIM ×60", "RUN auto · self-tuning-mv", "data 0.4 s old", "14:00:59"):
        assert said in state
    for said in ("37.49 °C", "−10 mK", "set 37.50 °C", "power 23.1 %", "holds with 19 %"):
        assert said in values


def test_beliefs_come_with_twice_their_standard_deviation(sixty: LiveModel) -> None:
    rows = [" ".join(row.split()) for row in texts(sixty.view(59.0))]
    assert rows[18].startswith("Pole a 0.9996 ± 0.0012 ")
    assert rows[19].startswith("Gain 2.42 ± 0.12 K/min ")
    assert "To hold 19 % " in rows[20]
    assert "Tick time 78 µs" in rows[21]


def test_what_is_not_known_is_a_dash_with_a_reason(model: LiveModel, make_cycle: MakeCycle) -> None:
    cycle = make_cycle(0.0, beliefs=Beliefs())
    unlearned = replace(cycle.step, estimate=Estimate(np.zeros(0), np.zeros((0, 0))))
    model.feed(replace(cycle, step=replace(unlearned, controller="on-off")))
    picture = "\n".join(texts(model.view(0.0)))
    assert picture.count("– on-off: no model") == 5
    assert "– after 30 innovations" in picture


def test_stale_inverts_the_first_row_and_hatches_the_charts(
    sixty: LiveModel, make_cycle: MakeCycle
) -> None:
    for k in range(60, 80):
        sixty.feed(make_cycle(float(k), quality=Quality.MISSING, accepted_power=0.1))
    look = Look(Colour.TRUE)
    first = render(sixty.view(79.0), 100, 30, look)[0]
    assert first.style == look.style(Role.STALE_BAR)
    assert {segment.style for segment in segments(first)} == {look.style(Role.STALE_BAR)}
    rows = texts(sixty.view(79.0))
    assert "STALE since 14:00:59 · heater 10.0 %" in rows[0]
    assert "– no sample" in rows[1]
    assert "╱" in rows[4]
    assert "37.49" not in "\n".join(rows[:9])


def test_a_latch_is_red_and_says_why_and_what_it_waits_for(
    sixty: LiveModel, make_cycle: MakeCycle
) -> None:
    text = "above 65.00 °C twice"
    alarm = Alarm("trip.over_temperature", 9, 1, 60.0, text, latched=True)
    quiet = Alarm("board.retry", 17, 3, 1.0, "one retry")
    sixty.feed(make_cycle(60.0, state=State.LATCHED, alarms=(quiet, alarm), accepted_power=0.0))
    look = Look(Colour.TRUE)
    first = render(sixty.view(60.0), 80, 24, look)[0]
    assert first.style == look.style(Role.RED_BAR)
    rows = texts(sixty.view(60.0), 80, 24)
    assert rows[0].startswith("tank   SIM ×60   ■ LATCHED · heater off")
    assert "STALE" not in rows[0]
    assert rows[1].startswith(f"37.49 °C  ■ trip.over_temperature: {text} · a acknowledges")


def test_what_a_latch_waits_for_is_said_after_the_longest_cause(
    sixty: LiveModel, make_cycle: MakeCycle
) -> None:
    text = "expected 5 to 55 degC, got 66.10 degC in two samples out of three, one after the other"
    alarm = Alarm("trip.over_temperature", 9, 1, 60.0, text, latched=True)
    sixty.feed(make_cycle(60.0, 66.1, state=State.LATCHED, alarms=(alarm,), accepted_power=0.0))
    row = texts(sixty.view(60.0), 80, 24)[1]
    assert row.startswith("66.10 °C  ■ trip.over_temperature: expected 5 to 55 °C, got")
    assert row.endswith("… · a acknowledges")
    plain = texts(sixty.view(60.0), 80, 24, Look(Colour.NONE, utf8=False))[1]
    assert plain.startswith("66.10 degC  # trip.over_temperature: expected 5 to 55 degC, go")
    assert plain.endswith("~ . a acknowledges")


def test_a_pause_is_said_in_the_first_row_and_its_key_is_listed(sixty: LiveModel) -> None:
    for width, height in ((80, 24), (100, 30)):
        rows = texts(sixty.view(59.0, paused=True), width, height)
        assert "SIM PAUSED" in rows[0]
        assert "×60" not in rows[0]
        assert "space  go on" in rows[-1]
        assert "space  pause" in texts(sixty.view(59.0), width, height)[-1]
        assert "q  quit" in rows[-1]
    assert "PAUSED" in texts(sixty.view(59.0, paused=True), 79, 1)[0]


@pytest.mark.parametrize("mode", [Mode.OFF, Mode.MANUAL])
def test_a_law_that_does_not_steer_is_neither_named_nor_judged(
    sixty: LiveModel, make_cycle: MakeCycle, mode: Mode
) -> None:
    assert "not white" in "\n".join(texts(sixty.view(59.0)))  # the innovations keep their sign
    sixty.feed(make_cycle(60.0, mode=mode))
    rows = texts(sixty.view(60.0))
    assert f"RUN {mode.value} " in rows[0]
    assert "self-tuning-mv" not in rows[0]
    assert "not white" not in "\n".join(rows)
    assert "judged in auto only" in "\n".join(rows)


def test_a_holding_power_that_was_known_is_not_known_at_this_set_point(
    sixty: LiveModel, make_cycle: MakeCycle
) -> None:
    vague = Beliefs(0.04, 0.001, 0.9996, 0.0006, None)
    sixty.feed(make_cycle(60.0, setpoint_c=55.0, beliefs=vague))
    for size in ((80, 24), (100, 30)):
        (row,) = (row for row in texts(sixty.view(60.0), *size) if row.startswith("To hold"))
        assert "– not at this set point" in row


def test_a_holding_power_that_was_never_known_is_not_known_yet(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    model.feed(make_cycle(0.0, beliefs=Beliefs(0.04, 0.001, 0.9996, 0.0006, None)))
    (row,) = (row for row in texts(model.view(0.0)) if row.startswith("To hold"))
    assert "– not known yet" in row


@pytest.mark.parametrize(
    ("temperature_c", "said"), [(12.48, "−25.02 K"), (162.5, "+125.0 K"), (37.41, "−90 mK")]
)
def test_the_label_of_the_deviation_keeps_its_unit(
    model: LiveModel, make_cycle: MakeCycle, temperature_c: float, said: str
) -> None:
    model.feed(make_cycle(0.0, temperature_c))
    assert any(row.rstrip().endswith(said) for row in texts(model.view(0.0), 80, 24)[7:13])


def test_latched_and_stale_are_both_said(sixty: LiveModel, make_cycle: MakeCycle) -> None:
    sixty.feed(make_cycle(60.0, quality=Quality.OPEN, state=State.LATCHED, accepted_power=0.0))
    assert "LATCHED · STALE since 14:00:59" in texts(sixty.view(70.0))[0]
    tight = texts(sixty.view(70.0), 80, 24)[0]
    assert "LATCHED · STALE since 14:00:59 · heater off" in tight
    assert tight.endswith("14:01:10")


@pytest.mark.parametrize(
    ("alarm", "said"),
    [
        (Alarm("a", None, 2, 0.0, ""), "▲ 1 active"),
        (Alarm("a", None, 1, 0.0, ""), "■ 1 active"),
        (Alarm("a", None, 2, 0.0, "", active=False), "△ 1 to ack"),
    ],
)
def test_alarms_have_a_shape_and_a_word_even_in_little_room(
    model: LiveModel, make_cycle: MakeCycle, alarm: Alarm, said: str
) -> None:
    model.feed(make_cycle(0.0, 12.34, alarms=(alarm,), accepted_power=1.0))
    assert said in texts(model.view(0.0), 80, 24)[1]


def test_a_belief_makes_room_for_an_alarm(model: LiveModel, make_cycle: MakeCycle) -> None:
    sure, gone = Beliefs(holding_power=1.0), Alarm("a", None, 2, 0.0, "", active=False)
    model.feed(make_cycle(0.0, 12.34, accepted_power=1.0, beliefs=sure))
    assert "holds with 100 %" in texts(model.view(0.0), 80, 24)[1]
    model.feed(make_cycle(1.0, 12.34, accepted_power=1.0, beliefs=sure, alarms=(gone,)))
    values = texts(model.view(1.0), 80, 24)[1]
    assert values.endswith("△ 1 to ack")
    assert "holds" not in values


def test_an_alarm_that_is_gone_and_acknowledged_is_quiet(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    gone = Alarm("a", None, 2, 0.0, "", active=False, acknowledged=True)
    model.feed(make_cycle(0.0, alarms=(gone,)))
    assert "△" not in texts(model.view(0.0))[1]


@pytest.mark.parametrize(("offset_k", "mark", "row"), [(0.5, "▴", 9), (-0.5, "▾", 13)])
def test_a_mark_shows_where_the_deviation_leaves_the_scale(
    model: LiveModel, make_cycle: MakeCycle, offset_k: float, mark: str, row: int
) -> None:
    for k in range(100):
        model.feed(make_cycle(float(k), 37.5 + offset_k))
    rows = texts(model.view(99.0))
    assert mark in rows[row]
    assert sum(text.count(mark) for text in rows) > 5
    for k in range(100, 200):
        model.feed(make_cycle(float(k), 37.5))
    marks = texts(model.view(199.0))[row].rindex(mark)
    assert marks < 65  # a hundred of five minutes' seconds ago, and no later


def test_a_change_point_is_a_line_through_the_charts_and_named_once(
    sixty: LiveModel, make_cycle: MakeCycle
) -> None:
    event = Event(30.0, "plant.changed", {"text": "cold water, about 1.0 kg"})
    sixty.note(event)
    rows = texts(sixty.view(59.0))
    assert sum("14:00 Cold water" in row for row in rows) == 1
    crossed = {row.index("┊") for row in rows if "┊" in row}
    assert len(crossed) == 1
    assert sum("┊" in row for row in rows) >= 6


def test_the_newest_event_is_on_top_with_its_name_at_the_right(sixty: LiveModel) -> None:
    sixty.note(Event(1.0, "loop.started", {"temperature_c": 25.0}))
    sixty.note(Event(2.0, "board.retry", {"board": "daq"}))
    rows = texts(sixty.view(59.0))
    assert rows[23].startswith("14:00:02")
    assert rows[23].rstrip().endswith("board.retry")
    assert "Loop started at 25.00 °C" in rows[24]


def test_the_same_column_is_the_same_time_from_top_to_bottom(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    for k in range(100):
        hot = 60 <= k < 64
        model.feed(make_cycle(float(k), 37.9 if hot else 37.5, accepted_power=float(hot)))
    rows = texts(model.view(99.0))
    power = {at for at, cell in enumerate(rows[14][7:91]) if cell != " "}
    (above,) = {row.index("▴") - 7 for row in rows if "▴" in row}
    assert above in power
    assert len(power) <= 4


def test_a_terminal_too_small_gets_one_line_with_everything(sixty: LiveModel) -> None:
    rows = texts(sixty.view(59.0), 79, 10)
    said = "14:00:59 RUN auto 37.49 °C −10 mK set 37.50 °C 23.1 % q quits"
    assert " ".join(rows[0].split()) == said
    assert not "".join(rows[1:]).strip()


@pytest.mark.parametrize("width", [20, 40, 79])
def test_the_way_out_of_a_small_terminal_is_the_last_to_go(sixty: LiveModel, width: int) -> None:
    assert texts(sixty.view(59.0), width, 1)[0].endswith("  q quits")


def test_a_small_terminal_shows_the_open_question(sixty: LiveModel) -> None:
    assert texts(sixty.view(59.0, "Enter: mode auto"), 60, 1)[0].startswith("Enter: mode auto")


def test_a_small_terminal_shows_the_temperature_beside_a_trip(
    sixty: LiveModel, make_cycle: MakeCycle
) -> None:
    alarm = Alarm("trip.over_temperature", 9, 1, 60.0, "x" * 90, latched=True)
    sixty.feed(make_cycle(60.0, 66.1, state=State.LATCHED, alarms=(alarm,)))
    row = texts(sixty.view(60.0), 79, 1)[0]
    assert "LATCHED auto  66.10 °C  trip.over_" in row
    assert row.endswith("a acknowledges  q quits")


def test_an_open_question_takes_the_row_of_keys(sixty: LiveModel) -> None:
    assert "cold water" in texts(sixty.view(59.0))[-1]
    assert texts(sixty.view(59.0, "Enter: mode auto"))[-1].strip() == "Enter: mode auto"


def test_keys_that_disturb_are_offered_on_a_simulation_only(
    facts: Facts, make_cycle: MakeCycle
) -> None:
    real = LiveModel(replace(facts, simulated=False))
    real.feed(make_cycle(0.0))
    rows = texts(real.view(0.0))
    assert "ice" not in rows[-1]
    assert "SIM" not in rows[0]


def shadowed(cycle: Cycle) -> Cycle:
    return replace(cycle, step=replace(cycle.step, shadow="on-off", shadow_power=0.25))


@pytest.mark.parametrize("look", [PLAIN, Look(Colour.NONE, utf8=False)])
@pytest.mark.parametrize("width", [80, 90, 100, 140])
def test_no_key_is_cut_off_and_the_controller_s_is_there_with_a_shadow_only(
    model: LiveModel, make_cycle: MakeCycle, width: int, look: Look
) -> None:
    model.feed(make_cycle(0.0))
    row = texts(model.view(0.0), width, 24, look)[-1]
    assert " c " not in row
    assert row.rstrip().endswith("quit")
    model.feed(shadowed(make_cycle(1.0)))
    row = texts(model.view(1.0, paused=True), width, 24, look)[-1]
    assert " c controller " in " ".join(row.split()) or " c law " in " ".join(row.split())
    assert row.rstrip().endswith("quit")


def test_a_daemon_that_has_gone_leaves_one_key_and_nothing_known(
    facts: Facts, make_cycle: MakeCycle
) -> None:
    model = LiveModel(replace(facts, simulated=False))
    model.feed(shadowed(make_cycle(0.0)))
    for width, height in ((80, 24), (100, 30)):
        rows = texts(model.view(1.0, lost="it has ended"), width, height)
        assert "STALE since 14:00:00 · daemon gone · heater not known" in rows[0]
        assert " ".join(rows[-1].split()) == "q quit asked again and again: it has ended"
        assert "╱" not in "".join(texts(model.view(1.0), width, height))
    assert "STALE  daemon gone" in texts(model.view(1.0, lost="it has ended"), 79, 1)[0]


def test_an_empty_view_says_so(model: LiveModel) -> None:
    picture = "\n".join(texts(model.view(0.0)))
    assert "waiting for the first sample" in picture
    assert "no data yet" in picture
    assert math.isnan(model.view(0.0).age_s)


def test_without_colour_no_style_has_a_hue() -> None:
    for role in Role:
        style = Look(Colour.NONE).style(role)
        assert style.color is None
        assert style.bgcolor is None
