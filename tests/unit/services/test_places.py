"""Where state and sockets live."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from thermoctl.errors import Unavailable
from thermoctl.services.places import make_private, runtime_dir, state_dir


@pytest.mark.parametrize(
    ("environ", "expected"),
    [
        ({"STATE_DIRECTORY": "/var/lib/thermoctl", "HOME": "/h"}, "/var/lib/thermoctl"),
        ({"STATE_DIRECTORY": "/var/lib/a:/var/lib/b"}, "/var/lib/a"),
        ({"XDG_STATE_HOME": "/x", "HOME": "/h"}, "/x/thermoctl"),
        ({"XDG_STATE_HOME": "x", "HOME": "/h"}, "/h/.local/state/thermoctl"),
        ({"HOME": "/h"}, "/h/.local/state/thermoctl"),
    ],
)
def test_state_follows_the_service_manager_then_the_user(environ, expected):
    assert state_dir(environ) == Path(expected)


@pytest.mark.parametrize(
    ("environ", "expected"),
    [
        ({"RUNTIME_DIRECTORY": "/run/thermoctl", "XDG_RUNTIME_DIR": "/x"}, "/run/thermoctl"),
        ({"XDG_RUNTIME_DIR": "/run/user/7"}, "/run/user/7/thermoctl"),
    ],
)
def test_sockets_follow_the_service_manager_then_the_user(environ, expected):
    assert runtime_dir(environ) == Path(expected)


@pytest.mark.parametrize("place", [state_dir, runtime_dir])
def test_an_empty_environment_still_has_an_absolute_place(place):
    assert place({}).is_absolute()


def test_a_folder_is_made_for_its_user_alone(tmp_path):
    made = make_private(tmp_path / "a" / "b")
    assert made.stat().st_mode & 0o777 == 0o700
    assert make_private(made) == made


def test_a_folder_everybody_may_write_into_is_refused(tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    with pytest.raises(Unavailable, match="0777"):
        make_private(shared)


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "x").write_text("")
    with pytest.raises(Unavailable, match="should be a folder"):
        make_private(tmp_path / "x")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_somebody_else_is_refused(tmp_path):
    os.chown(tmp_path, 12345, 12345)
    with pytest.raises(Unavailable, match="belongs to 12345"):
        make_private(tmp_path)
