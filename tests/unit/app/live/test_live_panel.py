import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.app.live.look import Colour, Look
from thermoctl.app.live.model import LiveModel, View
from thermoctl.app.live.render import render
from thermoctl.app.live.score import shadow_words
from thermoctl.insight import Change, Drift, Gate, Insight, Limit, Performance, Row
from thermoctl.signals import Alarm, Cycle, Event, Feasible, Mode, ShadowScore

MakeCycle = Callable[..., Cycle]
ROWS = (
    Row("gain", "gain", 2.415, 0.13, "K/min", "2.42 ± 0.13 K/min"),
    Row("loss", "loss", 0.46, 0.05, "K/min", "0.46 ± 0.05 K/min"),
    Row("holding_power", "holds with", 19.1, 0.6, "%", "19.1 ± 0.6 %"),
    Row("lag", "lag", 24.2, None, "s", "24 s", 19.0, 31.0),
    Row("noise", "noise", 7.4, None, "mK", "7 mK"),
    Row("volume", "water", None, None, "l", "– heater_w is not configured"),
)
VERDICT = "1.08 times the bound: close to what this delay allows"
INSIGHT = Insight(
    59.0, Gate.PAUSED, ROWS, (), (), Performance(VERDICT, Limit.NONE, 0.86, ratio=1.08)
)


def texts(view: View, width: int = 100, height: int = 30, *, utf8: bool = True) -> list[str]:
    look = Look(Colour.NONE, utf8)
    return [row.plain.replace("\u00a0", " ") for row in render(view, width, height, look)]


def spaced(view: View, width: int = 100, height: int = 30) -> list[str]:
    return [" ".join(row.split()) for row in texts(view, width, height)]


def fed(model: LiveModel, cycle: Cycle, insight: Insight | None) -> View:
    """Return the view after a minute of `cycle`."""
    for k in range(60):
        model.feed(replace(cycle, step=replace(cycle.step, t_s=float(k))), insight)
    return model.view(59.0)


@pytest.mark.parametrize("size", [(80, 24), (100, 30)])
def test_the_plant_is_told_in_physical_words_with_error_bars(
    model: LiveModel, make_cycle: MakeCycle, size: tuple[int, int]
) -> None:
    rows = spaced(fed(model, make_cycle(0.0), INSIGHT), *size)
    for begin in ("Gain 2.42 ± 0.13 K/min", "Loss 0.46 ± 0.05 K/min", "Lag 24 (19 to 31) s"):
        assert any(row.startswith(begin) for row in rows), begin
    assert any(row.startswith("To hold 19 ± 1 %") for row in rows)
    assert "holds with 19 ± 1 %" in rows[1]


@pytest.mark.parametrize("utf8", [True, False])
@pytest.mark.parametrize("size", [(80, 24), (100, 30), (140, 40)])
def test_errors_and_units_stand_below_each_other(
    model: LiveModel, make_cycle: MakeCycle, size: tuple[int, int], utf8: bool
) -> None:
    rows = texts(fed(model, make_cycle(0.0), INSIGHT), *size, utf8=utf8)
    shown = {row.split()[0]: row for row in rows if row.startswith(("Gain", "Loss", "Lag", "To "))}
    units = {"Gain": "K/min", "Loss": "K/min", "To": "% ", "Lag": " s "}
    at = {shown[name].index(unit) + unit.index(unit.strip()) for name, unit in units.items()}
    assert len(at) == 1
    sign = "±" if utf8 else "+-"
    assert len({shown[name].index(sign) for name in ("Gain", "Loss", "To")}) == 1
    inflation = next(row for row in rows if "1.00 " in row and row.startswith("Gain"))
    tick = next(row for row in rows if "Tick" in row)
    assert inflation.index("1.00 ") + len("1.00") == tick.index("78 ") + len("78")


@pytest.mark.parametrize(("utf8", "told"), [(True, "(28–158) s"), (False, "(28-158) s")])
def test_a_wide_range_keeps_its_brackets(
    model: LiveModel, make_cycle: MakeCycle, utf8: bool, told: str
) -> None:
    wide = Row("lag", "lag", 107.0, None, "s", "107 s", 28.0, 158.0)
    view = fed(model, make_cycle(0.0), replace(INSIGHT, rows=(*ROWS[:3], wide)))
    shown = [" ".join(row.split()) for row in texts(view, 80, 24, utf8=utf8)]
    assert any(row.startswith(f"Lag 107 {told}") for row in shown)


def test_a_loss_is_told_in_watts_per_kelvin_as_soon_as_that_is_known(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    better = Row("loss_w_per_k", "loss", 7.62, 0.2, "W/K", "7.6 ± 0.2 W/K")
    rows = spaced(fed(model, make_cycle(0.0), replace(INSIGHT, rows=(*ROWS, better))))
    assert any(row.startswith("Loss 7.6 ± 0.2 W/K") for row in rows)
    vague = replace(INSIGHT, rows=(*ROWS, replace(better, error=5.6)))
    rows = spaced(fed(model, make_cycle(0.0), vague))
    assert any(row.startswith("Loss 0.46 ± 0.05 K/min") for row in rows)


def test_more_rows_have_water_and_noise_and_say_what_is_missing(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    rows = spaced(fed(model, make_cycle(0.0), INSIGHT), 140, 40)
    assert any(row.startswith("Pole a 0.9996 ± 0.0012") and "Noise 7 mK" in row for row in rows)
    assert any(row.startswith("Water – heater_w is not configured Innovation") for row in rows)


def test_whether_it_learns_and_how_well_it_holds_stand_in_the_rules(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    view = fed(model, make_cycle(0.0), INSIGHT)
    for size in ((80, 24), (100, 30)):
        picture = "\n".join(texts(view, *size))
        assert "· learning paused: nothing to learn" in picture
        assert VERDICT in picture
        assert "1.08 × bound" in picture
    held = replace(INSIGHT, gate=Gate.HELD)
    assert "learning held: the water jumped" in "\n".join(texts(fed(model, make_cycle(0.0), held)))


def test_nobody_who_looks_is_the_panel_of_the_controller_alone(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    rows = spaced(fed(model, make_cycle(0.0), None))
    assert any(row.startswith("Pole a 0.9996 ± 0.0012") for row in rows)
    assert not any(row.startswith("Lag") for row in rows)


@pytest.mark.parametrize(
    ("sd", "told"), [(0.15, "Gain – not known yet"), (0.004, "Gain 2.40 ± 0.48")]
)
def test_a_gain_that_might_as_well_be_none_is_not_known(
    model: LiveModel, make_cycle: MakeCycle, sd: float, told: str
) -> None:
    cycle = make_cycle(0.0)
    vague = replace(cycle.step.beliefs, gain=0.04, gain_sd=sd)
    rows = spaced(fed(model, replace(cycle, step=replace(cycle.step, beliefs=vague)), None))
    assert any(row.startswith(told) for row in rows)


def test_nothing_told_yet_is_a_dash_and_no_empty_place(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    rows = spaced(fed(model, make_cycle(0.0), Insight()))
    for name in ("Loss", "Lag"):
        assert any(row.startswith(f"{name} – not known yet") for row in rows)


# -- the shadow ------------------------------------------------------------------------------------

SCORE = ShadowScore(600.0, 0.013, 0.5, 0.8, 0.021, 0.025)


def shadowed(cycle: Cycle, score: ShadowScore | None = SCORE) -> Cycle:
    step = replace(cycle.step, shadow="self-tuning-mv", shadow_power=0.2, shadow_score=score)
    return replace(cycle, step=step)


def test_the_shadow_has_a_row_of_its_own_where_there_is_one_and_room(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    view = fed(model, shadowed(make_cycle(0.0)), INSIGHT)
    words = "self-tuning-mv 20 % · 1.3 % apart · moves 1.6 × as much · misses by 25 mK, not 21 mK"
    assert f"Shadow {words}" in spaced(view)
    assert "Shadow self-tuning-mv 20 % · 1.3 % apart · moves 1.6 × as much" in spaced(view, 80, 25)
    assert not any(row.startswith("Shadow") for row in spaced(view, 80, 24))
    assert not any(row.startswith("Shadow") for row in spaced(fed(model, make_cycle(0.0), INSIGHT)))


def test_a_shadow_that_is_not_compared_yet_says_so(model: LiveModel, make_cycle: MakeCycle) -> None:
    view = fed(model, shadowed(make_cycle(0.0), None), INSIGHT)
    assert "Shadow self-tuning-mv 20 % · compared after a minute in auto" in spaced(view)


@pytest.mark.parametrize(
    ("charge", "shadow", "said"),
    [
        (0.5, 0.0, "stands still"),
        (0.0, 0.5, "moves, the one in charge does not"),
        (0.5, 0.25, "moves 0.5 × as much"),
        (0.01, 3.0, "moves 300 × as much"),
    ],
)
def test_how_much_it_moves_is_said_without_a_division_by_nothing(
    charge: float, shadow: float, said: str
) -> None:
    assert shadow_words(replace(SCORE, travel_per_min=charge, shadow_travel_per_min=shadow))[1] == (
        said
    )


numbers = st.floats()


@given(st.builds(ShadowScore, numbers, numbers, numbers, numbers, numbers, numbers))
def test_no_score_makes_words_that_hold_no_number(score: ShadowScore) -> None:
    assert not any(bad in words for words in shadow_words(score) for bad in ("nan", "inf"))


# -- what is to come of the set point --------------------------------------------------------------


def expecting(cycle: Cycle, feasible: Feasible, *alarms: Alarm) -> Cycle:
    return replace(cycle, step=replace(cycle.step, feasible=feasible, alarms=alarms))


HELD = Feasible(0.194, 0.01, 96.0, 5.0, 0.0, 0.0)
COMING = Feasible(0.38, 0.015, 96.0, 5.0, arrival_s=1500.0, arrival_sd_s=60.0)


def test_a_set_point_that_is_held_is_told_with_its_power(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    view = fed(model, expecting(make_cycle(0.0), HELD), None)
    for size in ((80, 24), (100, 30)):
        assert "power 23.1 % · holds with 19 ± 2 %" in spaced(view, *size)[1]
    assert any(row.startswith("To hold 19 ± 2 %") for row in spaced(view))


def test_a_set_point_that_is_far_is_told_with_power_and_arrival(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    cycle = expecting(make_cycle(0.0, 30.0, setpoint_c=44.0), COMING)
    view = fed(model, cycle, None)
    assert "· needs 38 ± 3 % · arrives 14:25 ± 2 min" in spaced(view)[1]
    assert spaced(view, 80, 24)[1].endswith("power 23.1 % · arrives 14:25 ± 2 min")


def test_what_is_known_too_vaguely_is_not_told_at_the_top(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    vague = Feasible(0.045, 0.227, math.nan, math.nan, 130.0, 21.0)
    row = spaced(fed(model, expecting(make_cycle(0.0), vague), None))[1]
    assert "needs" not in row
    assert "arrives 14:03 ± 1 min" in row


def test_a_set_point_out_of_reach_says_what_can_be_held(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    alarm = Alarm("setpoint.unreachable", None, 2, 0.0, "at most 41.2 +-0.3 degC")
    most = Feasible(1.3, 0.02, 41.2, 0.25, math.nan, math.nan)
    view = fed(model, expecting(make_cycle(0.0), most, alarm), None)
    assert "· out of reach: at most 41.2 ± 0.5 °C" in spaced(view)[1]
    assert "▲ 1 active" in spaced(view)[1]
    over = fed(model, expecting(make_cycle(0.0), most, replace(alarm, active=False)), None)
    assert "out of reach" not in spaced(over)[1]


def test_what_can_be_held_is_said_in_eighty_columns_too(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    alarm = Alarm("setpoint.unreachable", None, 2, 0.0, "at most 41.2 +-0.3 degC")
    most = Feasible(1.3, 0.02, 41.2, 0.25, math.nan, math.nan)
    far = make_cycle(0.0, 30.0, setpoint_c=50.0, accepted_power=1.0)
    row = spaced(fed(model, expecting(far, most, alarm), None), 80, 24)[1]
    assert "power 100.0 % · at most 41.2 °C" in row
    assert row.endswith("▲ 1 active")


def test_the_coldest_that_can_be_held_is_no_most(model: LiveModel, make_cycle: MakeCycle) -> None:
    alarm = Alarm("setpoint.unreachable", None, 2, 0.0, "at least 12.1 +-0.3 degC")
    least = Feasible(1.3, 0.02, 12.1, 0.15, math.nan, math.nan)
    cold = make_cycle(0.0, 15.0, setpoint_c=8.0)
    row = spaced(fed(model, expecting(cold, least, alarm), None))[1]
    assert "out of reach: at least 12.1 ± 0.3 °C" in row


def test_nothing_is_expected_of_a_loop_that_is_off(model: LiveModel, make_cycle: MakeCycle) -> None:
    row = spaced(fed(model, expecting(make_cycle(0.0, mode=Mode.OFF), COMING), None))[1]
    assert "arrives" not in row
    assert "needs" not in row


def test_a_ramp_is_told_of_and_what_it_follows_is_what_deviates(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    cycle = make_cycle(0.0, 39.25, setpoint_c=44.0)
    view = fed(model, replace(cycle, step=replace(cycle.step, reference_c=39.2)), None)
    for size in ((80, 24), (100, 30)):
        assert spaced(view, *size)[1].startswith(
            "39.25 °C +50 mK set 44.00 °C ramp at 39.20 °C power 23.1 %"
        )
    off = make_cycle(0.0, 39.25, setpoint_c=44.0, mode=Mode.OFF)
    view = fed(model, replace(off, step=replace(off.step, reference_c=39.25)), None)
    assert "−4.75 K set 44.00 °C power" in spaced(view)[1]


# -- below zero ------------------------------------------------------------------------------------


def test_a_power_below_zero_has_a_strip_of_both_signs_and_a_name_of_its_own(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    for k in range(60):
        power = 0.5 if k < 30 else -0.5
        model.feed(make_cycle(float(k), accepted_power=power))
    rows = texts(model.view(59.0))
    top, bottom = (next(row for row in rows if row.startswith(it)) for it in (" 100 %", "−100 %"))
    assert bottom.rstrip().endswith("−50.0 %")
    heats = {at for at, cell in enumerate(top[7:80]) if cell != " "}
    cools = {at for at, cell in enumerate(bottom[7:80]) if cell != " "}
    assert max(heats - cools) < min(cools)  # a column of zero belongs to the upper row
    stale = texts(model.view(79.0))
    assert "STALE since 14:00:59 · cooler 50.0 %" in stale[0]


def test_a_change_of_the_plant_is_drawn_where_it_began_and_told_once(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    late = Event(50.0, "plant.changed", {"text": "step loss of 3.1 ± 0.2 K"})
    cycle = make_cycle(0.0)
    view = fed(model, cycle, replace(INSIGHT, changes=(changed("step loss of 3.1 ± 0.2 K"),)))
    model.feed(make_cycle(60.0, events=(late,)), view.insight)
    rows = texts(model.view(60.0))
    assert any("14:00 Step loss of 3.1 ± 0.2 K" in row for row in rows[3:9])
    assert [row[:22] for row in rows if "◆" in row] == ["14:00:30  ◆ Step loss "]


def changed(text: str) -> Change:
    return Change(30.0, "step.loss", -3.1, 0.2, "K", text)


def test_a_change_with_little_room_beside_it_is_named_by_its_first_words(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    text = "step loss of 3.1 ± 0.2 K, 106 kJ, about 1.0 kg of water of 10 °C or 0.2 kg of ice"
    view = fed(model, make_cycle(0.0), replace(INSIGHT, changes=(changed(text),)))
    assert any("14:00 Step loss of 3.1 ± 0.2 K ┊" in row for row in texts(view, 80, 24)[3:7])


def test_without_braille_there_is_no_spark_that_says_nothing(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    rows = texts(fed(model, make_cycle(0.0), INSIGHT), utf8=False)[18:22]
    assert not any("**" in row or "##" in row for row in rows)


def test_a_drift_is_a_warning_until_it_is_gone(model: LiveModel, make_cycle: MakeCycle) -> None:
    drift = Drift("water.low", 10.0, "less water", 1.0, 1.3, 6.0)
    fed(model, make_cycle(0.0), replace(INSIGHT, drifts=(drift,)))
    model.feed(make_cycle(60.0), INSIGHT)
    rows = texts(model.view(60.0))
    assert any(row.startswith("14:00:10  △ Less water") for row in rows)
    assert any(row.startswith("14:01:00    No longer: less water") for row in rows)
    assert sum("ess water" in row and "plant.drift" in row for row in rows) == 2
