"""Where the socket is: stale ones are replaced, living ones and strangers are left alone."""

import os
import socket
import stat

import pytest

from thermoctl.errors import Unavailable
from thermoctl.services.control_place import (
    SERVICE,
    ControlPlace,
    checked,
    mode_for,
    own_path,
    usual_paths,
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "control.sock"


def dead_socket(path):
    """Leave what a killed process leaves: a socket that nobody listens to."""
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))


def test_it_listens_with_the_rights_asked_for_and_is_gone_when_closed(path):
    for mode in (0o600, 0o660):
        place = ControlPlace(path, mode)
        place.open()
        assert stat.S_IMODE(path.lstat().st_mode) == mode
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(path))
        place.close()
        assert not path.exists()


def test_nobody_else_may_connect_even_before_the_rights_are_set(path, monkeypatch):
    seen, chmod = [], os.chmod

    def watched(where, mode):
        seen.append(stat.S_IMODE(path.lstat().st_mode))
        chmod(where, mode)

    monkeypatch.setattr(os, "chmod", watched)
    before = os.umask(0)
    try:
        place = ControlPlace(path, 0o660)
        place.open()
        place.close()
    finally:
        os.umask(before)
    assert seen == [0o600]


def test_a_stale_socket_is_replaced(path):
    dead_socket(path)
    place = ControlPlace(path, 0o600)
    place.open()
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(path))
    place.close()


def test_a_second_daemon_is_refused_and_the_first_keeps_its_socket(path):
    first, second = ControlPlace(path, 0o600), ControlPlace(path, 0o600)
    first.open()
    with pytest.raises(Unavailable, match=str(os.getpid())):
        second.open()
    second.close()
    assert not first.lost
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(path))
    first.close()


def test_a_living_socket_of_a_program_without_our_lock_is_left_alone(path):
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        other.listen(1)
        before = path.lstat().st_ino
        with pytest.raises(Unavailable, match="answers"):
            ControlPlace(path, 0o600).open()
        assert path.lstat().st_ino == before


def test_a_living_socket_with_a_full_queue_is_left_alone(path):
    with socket.socket(socket.AF_UNIX) as other, socket.socket(socket.AF_UNIX) as waiting:
        other.bind(str(path))
        other.listen(0)
        waiting.setblocking(False)
        waiting.connect(str(path))
        with pytest.raises(Unavailable, match="answers"):
            ControlPlace(path, 0o600).open()
    assert path.exists()


@pytest.mark.parametrize("kind", ["file", "folder", "link"])
def test_what_is_no_socket_is_never_removed(path, kind):
    if kind == "file":
        path.write_text("precious")
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("elsewhere")
    with pytest.raises(Unavailable, match="something else"):
        ControlPlace(path, 0o600).open()
    assert path.is_symlink() or path.exists()


def test_a_path_that_was_taken_over_is_noticed_and_not_removed(path):
    place = ControlPlace(path, 0o600)
    place.open()
    assert not place.lost
    path.unlink()
    assert place.lost
    dead_socket(path)
    place.close()
    assert path.exists()


def test_after_a_refusal_the_place_is_free_for_another_try(path):
    path.write_text("in the way")
    place = ControlPlace(path, 0o600)
    with pytest.raises(Unavailable):
        place.open()
    path.unlink()
    place.open()
    place.close()


def test_a_path_too_long_for_a_socket_is_refused_with_its_length(tmp_path):
    longest = "/" + "x" * 106
    assert str(checked(tmp_path / longest)) == longest
    with pytest.raises(Unavailable, match="at most 107 bytes, got 108"):
        checked(tmp_path / (longest + "x"))


def test_the_user_s_own_socket_comes_before_the_service_s(tmp_path):
    own = {"XDG_RUNTIME_DIR": str(tmp_path)}
    assert own_path(own) == tmp_path / "thermoctl" / "control.sock"
    assert usual_paths(own) == [own_path(own), SERVICE]
    service = {"RUNTIME_DIRECTORY": "/run/thermoctl"}
    assert usual_paths(service) == [SERVICE]
    assert (mode_for(own), mode_for(service)) == (0o600, 0o660)


def test_a_daemon_listens_at_its_own_path_unless_given_another(tmp_path):
    own = {"XDG_RUNTIME_DIR": str(tmp_path)}
    assert ControlPlace.of_daemon(None, own).path == own_path(own)
    assert ControlPlace.of_daemon(tmp_path / "x", own).path == tmp_path / "x"


def test_a_path_in_a_folder_that_is_not_there_is_refused_and_makes_none(tmp_path):
    folder = tmp_path / "mistyped"
    with pytest.raises(Unavailable, match=f"expected a folder for --socket {folder}/x, got none"):
        ControlPlace.of_daemon(folder / "x")
    assert not folder.exists()
