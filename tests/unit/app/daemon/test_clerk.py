"""Calls answered: from the last cycles, or through the loop's queue and after its cycle."""

import json
from pathlib import Path

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.daemon.clerk import Clerk
from thermoctl.app.parts import law_of_kind
from thermoctl.app.settings import load
from thermoctl.services.control_protocol import Call, CallError
from thermoctl.services.plain import as_json
from thermoctl.services.store import Latch, LatchStore
from thermoctl.signals import Alarm
from thermoctl.testing import ManualClock

BOARD = {"kind": "null"}
TABLE = {
    "setpoint_c": 37.5,
    "trip_above_c": 60.0,
    "setpoint_max_c": 55.0,
    "mode": "auto",
    "controller": "on-off",
    "shadow": "adaptive",
}


def wired(board):
    """Return the tables that connect a loop to a board of its own."""
    sensor = {"board": board, "input": "temperature", "curve": "lm335", "reference_v": 5.0}
    return {"sensor": sensor, "actuator": {"board": board, "output": "heater"}}


class Desk:
    """A clerk, the loop he asks, and cycles when a test wants one."""

    def __init__(self, folder, names=("tank",), latched=None):
        self.settings = load(
            {
                "boards": {f"b-{name}": BOARD for name in names},
                "loops": {name: TABLE | wired(f"b-{name}") for name in names},
            }
        )
        self.clock, self.seen = ManualClock(), {}
        self.latches = LatchStore(folder)
        self.loop = loop_for(
            self.settings, self.clock, self._publish, latched=latched or {}, beside=False
        )
        periods_s = {name: table.period_s for name, table in self.settings.loops.items()}
        self.clerk = Clerk(
            self.loop,
            self.seen,
            periods_s,
            self.latches,
            folder,
            self.clock.now_s,
            lambda: 1.7e9,
            law=lambda name, kind: law_of_kind(self.settings.loops[name], kind),
        )

    def _publish(self, cycle):
        self.seen[cycle.loop] = cycle

    def cycle(self):
        self.clock.advance(1.0)
        self.loop.cycle(self.clock.now_s())

    def ask(self, do, argument=None, loop=None):
        return self.clerk.answer(Call(do, 1, loop, argument))

    def granted(self, do, argument=None, loop=None):
        pending = self.ask(do, argument, loop)
        assert pending() is None
        self.cycle()
        return pending()


@pytest.fixture
def desk(tmp_path):
    made = Desk(tmp_path)
    made.cycle()
    return made


def code_of(ask):
    with pytest.raises(CallError) as refused:
        ask()
    return refused.value.code


def test_any_kind_of_law_learns_in_the_shadow_and_then_takes_charge(desk):
    assert desk.granted("shadow", "pid") == {"loop": "tank", "shadow": "pid"}
    assert desk.ask("get", "shadow")["value"] == "pid"
    assert desk.granted("controller", "pid")["controller"] == "pid"
    assert desk.granted("shadow", "none") == {"loop": "tank", "shadow": None}
    assert desk.ask("get", "shadow")["value"] is None


def test_a_law_that_there_is_not_or_that_is_in_charge_stays_out_of_the_shadow(desk):
    with pytest.raises(CallError, match=r"^no controller is called 'magic'; known: adap"):
        desk.ask("shadow", "magic")
    assert code_of(lambda: desk.granted("shadow", "on-off")) == "refused"
    assert desk.ask("get", "shadow")["value"] == "adaptive"


def test_a_request_is_answered_after_the_cycle_that_granted_it(desk):
    assert desk.granted("set", 40.0) == {"loop": "tank", "setpoint_c": 40.0}
    assert desk.ask("get", "setpoint_c")["value"] == 40.0
    assert desk.granted("mode", "manual") == {"loop": "tank", "mode": "manual"}
    assert desk.granted("output", 0.3) == {"loop": "tank", "power": 0.3}
    assert desk.ask("get", "power")["value"] == 0.3
    assert desk.granted("controller", "adaptive") == {"loop": "tank", "controller": "adaptive"}
    assert desk.ask("get", "controller")["value"] == "adaptive"


@pytest.mark.parametrize(
    ("do", "argument", "told"),
    [
        ("set", 99.0, "from 5 to 55|from .* to 55"),
        ("controller", "magic", "magic"),
        ("ack", "no.such", "no.such"),
    ],
)
def test_a_refusal_of_the_loop_is_the_reply_word_for_word(desk, do, argument, told):
    pending = desk.ask(do, argument)
    desk.cycle()
    with pytest.raises(CallError, match=told) as refused:
        pending()
    assert refused.value.code == "refused"
    assert desk.ask("get", "setpoint_c")["value"] == 37.5


def test_words_that_mean_nothing_never_reach_the_loop(desk):
    assert code_of(lambda: desk.ask("mode", "program")) == "bad_value"
    assert code_of(lambda: desk.ask("mode", "warm")) == "bad_value"
    assert code_of(lambda: desk.ask("get", "wisdom")) == "unknown_key"
    assert code_of(lambda: desk.ask("set", 40.0, "bath")) == "no_loop"
    assert code_of(lambda: desk.ask("status", None, "bath")) == "no_loop"
    assert desk.loop._requests.qsize() == 0


def test_a_power_outside_mode_manual_is_refused_because_it_would_be_forgotten(desk):
    assert code_of(lambda: desk.ask("output", 0.3)) == "not_manual"


def test_several_loops_want_one_named_and_a_status_shows_all(tmp_path):
    desk = Desk(tmp_path, ("a", "b"))
    assert desk.ask("status")["waiting"] == ["a", "b"]
    assert code_of(lambda: desk.ask("get", "power", "a")) == "no_cycle"
    desk.cycle()
    with pytest.raises(CallError, match="a, b"):
        desk.ask("set", 40.0)
    assert desk.granted("set", 40.0, "b")["loop"] == "b"
    assert [each["setpoint_c"] for each in desk.ask("status")["loops"]] == [37.5, 40.0]
    assert [each["loop"] for each in desk.ask("status", None, "b")["loops"]] == ["b"]


def test_status_says_how_old_the_last_cycle_is(desk):
    desk.clock.advance(4.0)
    (record,) = desk.ask("status")["loops"]
    assert (record["age_s"], record["missed"], record["period_s"]) == (4.0, 0, 1.0)
    assert json.loads(as_json(record))["temperature_c"] == pytest.approx(25.0, abs=0.01)


def test_status_names_the_state_folder_for_whoever_runs_elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    desk = Desk(Path("state"), ("tank",))
    assert desk.ask("status")["state_directory"] == str(tmp_path / "state")


def test_a_loop_that_answers_too_late_finds_the_request_taken_back(desk):
    pending = desk.ask("set", 40.0)
    desk.clock.advance(desk.clerk.patience_s + 0.1)
    with pytest.raises(CallError, match="taken back") as late:
        pending()
    assert late.value.code == "no_answer"
    desk.cycle()
    assert desk.ask("get", "setpoint_c")["value"] == 37.5


def test_a_latch_is_listed_since_its_own_time_and_acknowledged_once_its_file_is_gone(tmp_path):
    latched = Alarm("trip.over_temperature", 5, 1, 0.0, "too hot", latched=True)
    desk = Desk(tmp_path, latched={"tank": latched})
    desk.latches.save("tank", Latch(latched.code, latched.text, 5, 1.6e9))
    desk.cycle()
    (row,) = desk.ask("alarms")["alarms"]
    assert (row["code"], row["latched"], row["since"]) == (
        latched.code,
        True,
        "2020-09-13T12:26:40+00:00",
    )
    pending = desk.ask("ack")
    desk.cycle()
    assert pending() is None
    desk.latches.clear("tank")
    assert [each["code"] for each in pending()["acknowledged"]] == [latched.code]
    assert desk.ask("alarms") == {"alarms": []}


def test_before_its_first_cycle_a_loop_has_the_alarm_that_latched_it_in_its_last_run(tmp_path):
    desk = Desk(tmp_path)
    assert desk.ask("alarms") == {"alarms": []}
    desk.latches.save("tank", Latch("trip.over_temperature", "61 degC", 5, 1.6e9))
    (row,) = desk.ask("alarms")["alarms"]
    assert (row["code"], row["latched"]) == ("trip.over_temperature", True)
    pending = desk.ask("ack")
    assert pending() is None  # nobody has asked the loop yet, and nobody falls over it
