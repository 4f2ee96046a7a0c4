"""What a shell offers after TAB."""

from __future__ import annotations

import pytest
from click.shell_completion import ShellComplete

from thermoctl.app.cli import cli


@pytest.fixture
def offered(tmp_path, monkeypatch):
    """Return what is offered behind words, on a machine where no daemon runs."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

    def offered(*words, typed=""):
        came = ShellComplete(cli, {}, "thermoctl", "_THERMOCTL_COMPLETE").get_completions(
            list(words), typed
        )
        return [each.value for each in came]

    return offered


def test_the_modes_are_offered(offered):
    assert offered("mode") == ["auto", "manual", "off"]
    assert offered("mode", typed="m") == ["manual"]


def test_the_laws_that_may_stand_in_the_shadow_are_offered(offered):
    assert {"adaptive", "pid", "none"} <= set(offered("shadow"))
    assert offered("shadow", typed="self-tuning-g") == ["self-tuning-gpc"]


@pytest.mark.parametrize(
    "words",
    [("get", "--socket", "none.sock"), ("controller", "--socket", "x"), ("set", "--loop")],
)
def test_without_a_daemon_nothing_is_offered_and_nothing_fails(offered, tmp_path, words):
    if "--socket" not in words:
        words = (words[0], "--socket", str(tmp_path / "none.sock"), *words[1:])
    assert offered(*words) == []
