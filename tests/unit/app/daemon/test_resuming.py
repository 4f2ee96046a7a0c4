"""What a restart takes up: off by default, the last wish with resume, an edited file above all."""

from dataclasses import dataclass

import pytest

from thermoctl.app.daemon.resuming import Resumption
from thermoctl.app.settings import load
from thermoctl.signals import Mode


@dataclass
class Seen:
    """A cycle, as far as a resumption looks at it."""

    mode: Mode
    setpoint_c: float
    controller: str = "adaptive"

    @property
    def step(self):
        return self


class Starts:
    """Starts of a daemon one after the other on one state folder."""

    def __init__(self, folder):
        self.folder, self.told = folder, []

    def start(self, then=None, **keys):
        """Start with `keys` in the configuration; store `then`, or what the start begins with."""
        loop = {"setpoint_c": 30.0, "trip_above_c": 60.0, "mode": "auto"} | keys
        settings = load({"loops": {"tank": loop}})
        resumption = Resumption(self.folder, lambda name, *_, **fields: self.told.append(name))
        begun = resumption.settings(settings).loops["tank"]
        cycle = then or Seen(begun.mode, begun.setpoint_c)
        resumption.store(settings, {"tank": cycle})
        return begun.mode, begun.setpoint_c


@pytest.fixture
def starts(tmp_path):
    return Starts(tmp_path)


def test_the_first_start_is_as_configured(starts):
    assert starts.start() == (Mode.AUTO, 30.0)
    assert starts.told == []


def test_a_restart_is_off_and_says_so(starts):
    starts.start()
    assert starts.start() == (Mode.OFF, 30.0)
    assert starts.told == ["loop.not_resumed"]


def test_with_resume_it_goes_on_as_the_operator_left_it(starts):
    starts.start(then=Seen(Mode.MANUAL, 41.0), resume=True)
    assert starts.start(resume=True) == (Mode.MANUAL, 41.0)


def test_a_set_point_that_is_not_the_configured_one_is_told(starts):
    starts.start(then=Seen(Mode.AUTO, 41.0), resume=True)
    assert starts.told == []
    starts.start(resume=True)
    assert starts.told == ["setpoint.resumed"]
    starts.start(resume=True, setpoint_c=35.0)
    assert starts.told == ["setpoint.resumed"]


def test_a_start_that_only_stayed_off_is_no_wish_to_be_off(starts):
    starts.start()
    starts.start()
    starts.start()
    assert starts.start(resume=True) == (Mode.AUTO, 30.0)


def test_an_operator_who_switched_it_off_keeps_it_off(starts):
    starts.start(then=Seen(Mode.OFF, 30.0), resume=True)
    assert starts.start(resume=True) == (Mode.OFF, 30.0)


def test_an_edited_mode_is_a_first_start(starts):
    starts.start(mode="off")
    assert starts.start(mode="auto") == (Mode.AUTO, 30.0)


def test_an_edited_set_point_is_newer_than_a_stored_one(starts):
    starts.start(then=Seen(Mode.AUTO, 41.0), resume=True)
    assert starts.start(resume=True, setpoint_c=35.0) == (Mode.AUTO, 35.0)


def test_a_stored_set_point_outside_today_s_limits_is_not_taken(starts):
    starts.start(then=Seen(Mode.AUTO, 55.0), resume=True)
    assert starts.start(resume=True, setpoint_max_c=50.0) == (Mode.AUTO, 30.0)


SWAPPED = Seen(Mode.AUTO, 30.0, controller="pid")
LAWS = {"controller": "adaptive", "shadow": "pid", "resume": True}


def begun_laws(starts, **keys):
    """Return the laws in charge and in shadow of a start, which tells what it resumed."""
    loop = {"setpoint_c": 30.0, "trip_above_c": 60.0, "mode": "auto"} | keys
    resumption = Resumption(starts.folder, lambda name, *_, **fields: starts.told.append(name))
    table = resumption.settings(load({"loops": {"tank": loop}})).loops["tank"]
    return table.controller.kind, None if table.shadow is None else table.shadow.kind


def test_a_controller_that_was_put_in_charge_stays_there_over_a_restart(starts):
    starts.start(then=SWAPPED, **LAWS)
    assert begun_laws(starts, **LAWS) == ("pid", "adaptive")
    assert starts.told == ["controller.resumed"]


def test_one_that_was_put_back_is_back(starts):
    starts.start(then=SWAPPED, **LAWS)
    starts.start(then=Seen(Mode.AUTO, 30.0, controller="adaptive"), **LAWS)
    assert begun_laws(starts, **LAWS) == ("adaptive", "pid")


def test_a_restart_that_does_not_resume_has_the_laws_as_configured(starts):
    starts.start(then=SWAPPED, **LAWS)
    assert begun_laws(starts, **LAWS | {"resume": False}) == ("adaptive", "pid")


@pytest.mark.parametrize(
    "edited", [{"controller": "on-off"}, {"shadow": "on-off"}, {"shadow": None}], ids=str
)
def test_laws_that_were_edited_since_are_the_newer_wish(starts, edited):
    starts.start(then=SWAPPED, **LAWS)
    keys = {name: value for name, value in (LAWS | edited).items() if value is not None}
    assert begun_laws(starts, **keys) == (keys["controller"], keys.get("shadow"))
    assert "controller.resumed" not in starts.told


def test_a_record_of_laws_that_is_none_is_ignored_with_a_warning(starts):
    starts.start(then=SWAPPED, **LAWS)
    (path,) = starts.folder.glob("run-*.json")
    path.write_text(path.read_text().replace('"adaptive",', "7,"))
    assert begun_laws(starts, **LAWS) == ("adaptive", "pid")
    assert starts.told == ["state.ignored", "loop.not_resumed"]


@pytest.mark.parametrize(
    "content", ["", '{"format": 1, "cont', "[]"], ids=["empty", "torn", "list"]
)
@pytest.mark.parametrize("resume", [True, False])
def test_a_wish_that_cannot_be_read_may_have_been_off(starts, content, resume):
    starts.start(then=Seen(Mode.OFF, 30.0), resume=resume)
    (path,) = starts.folder.glob("run-*.json")
    path.write_text(content)
    assert starts.start(resume=resume) == (Mode.OFF, 30.0)
    assert starts.told == ["state.ignored", "loop.not_resumed"]


def test_a_loop_that_begins_off_anyway_has_nothing_to_resume(starts):
    starts.start(mode="off")
    (path,) = starts.folder.glob("run-*.json")
    path.write_text("")
    assert starts.start(mode="off") == (Mode.OFF, 30.0)
    assert starts.told == ["state.ignored"]
