"""The watch beside the loops of the daemon, and what `status` makes of it."""

from __future__ import annotations

import pytest

from thermoctl.app.daemon.clerk import Clerk
from thermoctl.app.daemon.insight_watch import InsightService, insights_for
from thermoctl.app.daemon.insight_words import insight_lines
from thermoctl.app.sim import bench_settings, simulate
from thermoctl.insight import Change, Drift, Gate, Insight, Insights, Performance, Row
from thermoctl.services.control_protocol import Call
from thermoctl.signals import Event


def cycles(seconds):
    return list(simulate(bench_settings(), seconds))


class Telling(Insights):
    """A watch that has news after every step."""

    def after(self, step, accepted_power):
        super().after(step, accepted_power)
        return (Event(step.t_s, "plant.changed", {"text": "step loss"}),)


class Failing(Insights):
    def after(self, step, accepted_power):
        raise ZeroDivisionError("no lag")


def served(watch, seconds=5):
    seen = cycles(seconds)
    told = []
    service = InsightService(
        {seen[0].loop: watch}, lambda name, loop, **fields: told.append((name, loop, fields))
    )
    for cycle in seen:
        service.step(cycle)
    return service, seen[0].loop, told


def test_a_loop_is_told_of_as_soon_as_a_cycle_was_looked_at():
    service, loop, told = served(Insights())
    assert service.insight(loop).rows
    assert service.insight("another") is None
    assert told == []


def test_news_are_reported_under_the_name_of_their_loop():
    _, loop, told = served(Telling(), 2)
    assert told[0] == ("plant.changed", loop, {"text": "step loss"})


def test_a_watch_that_fails_is_dropped_and_told_of_once():
    service, loop, told = served(Failing())
    assert told == [("insight.failed", loop, {"error": "ZeroDivisionError: no lag"})]
    assert service.insight(loop) is None


def test_every_loop_has_a_watch():
    settings = bench_settings()
    assert set(insights_for(settings.loops)) == set(settings.loops)


def test_status_has_what_is_told_with_times_of_the_wall_clock(tmp_path):
    change = Change(40.0, "step.loss", -1.0, 0.1, "K", "step loss")
    seen = cycles(3)[-1]
    clerk = Clerk(
        loop=None,
        seen={seen.loop: seen},
        periods_s={seen.loop: 1.0},
        latches=None,
        state=tmp_path,
        now_s=lambda: 100.0,
        wall_clock=lambda: 1_000_060.0,
        insight=lambda loop: Insight(100.0, Gate.PAUSED, changes=(change,)),
    )
    (record,) = clerk.answer(Call("status"))["loops"]
    (told,) = record["insight"]["changes"]
    assert told["text"] == "step loss"
    assert told["at"] == "1970-01-12T13:46:40+00:00"  # a minute ago


def test_nothing_is_told_of_a_loop_without_a_watch():
    assert insight_lines(None) == []


def test_a_status_has_a_line_a_quantity_and_the_newest_changes():
    told = Insight(
        10.0,
        Gate.PAUSED,
        (
            Row("gain", "gain", 2.6, 0.1, "K/min", "2.6 ± 0.1 K/min"),
            Row("loss", "loss", 0.5, 0.1, "K/min", "0.5 ± 0.1 K/min"),
            Row("volume", "water", None, None, "l", "– heater_w is not configured"),
            Row("loss_w", "loss", 270.0, 10.0, "W", "270 ± 10 W"),
        ),
        tuple(Change(float(k), "step.loss", -1.0, 0.1, "K", f"loss {k}") for k in range(5)),
        (Drift("water.low", 0.0, "the water is low", 0.04, 0.08, 9.0),),
        Performance("close to what this delay allows"),
    ).as_json()
    for row in (*told["changes"], *told["drifts"]):
        row["at"] = "2026-01-01T12:00:00+00:00"
    lines = insight_lines(told)
    assert ("Learning", "paused: nothing to learn") in lines
    assert ("Loss", "0.5 ± 0.1 K/min, 270 ± 10 W") in lines
    assert ("Water", "– heater_w is not configured") in lines
    assert [text[6:] for name, text in lines if name == "Changed"] == ["loss 0", "loss 1", "loss 2"]
    assert [text[6:] for name, text in lines if name == "Drift"] == ["the water is low"]


@pytest.mark.parametrize("unknown", [None])
def test_a_time_that_is_not_known_is_a_dash(unknown):
    told = Insight(0.0, changes=(Change(0.0, "jump", None, None, "K", "jumped"),)).as_json()
    told["changes"][0]["at"] = unknown
    assert insight_lines(told)[-1] == ("Changed", "– jumped")
