"""sd_notify against a real datagram socket."""

from __future__ import annotations

import os
import re
import socket
import threading

import pytest

from thermoctl.services.notify import Notifier, watchdog_interval_s


@pytest.fixture(params=["path", "abstract"])
def manager(request, tmp_path):
    """Return a service manager's socket and the environment that names it."""
    name = f"@thermoctl-test-{os.getpid()}" if request.param == "abstract" else f"{tmp_path}/notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(name.replace("@", "\0", 1))
        server.settimeout(10.0)
        yield server, {"NOTIFY_SOCKET": name}


@pytest.mark.parametrize(
    ("send", "message"),
    [
        (lambda n: n.ready(), "READY=1"),
        (lambda n: n.ready("holding 41"), "READY=1\nSTATUS=holding 41"),
        (lambda n: n.status("40.9 °C"), "STATUS=40.9 °C"),
        (lambda n: n.status("one\nREADY=1\n"), "STATUS=one READY=1"),
        (lambda n: n.watchdog(), "WATCHDOG=1"),
        (lambda n: n.stopping(), "STOPPING=1"),
    ],
)
def test_each_message_arrives_as_one_datagram(manager, send, message):
    server, environ = manager
    notifier = Notifier(environ)
    assert send(notifier)
    notifier.close()
    assert server.recv(4096).decode() == message


def test_a_reload_carries_the_monotonic_time(manager):
    server, environ = manager
    notifier = Notifier(environ)
    assert notifier.reloading()
    notifier.close()
    assert re.fullmatch(r"RELOADING=1\nMONOTONIC_USEC=\d+", server.recv(4096).decode())


@pytest.mark.parametrize(
    "environ",
    [{}, {"NOTIFY_SOCKET": ""}, {"NOTIFY_SOCKET": "vsock:2:1234"}, {"NOTIFY_SOCKET": "x"}],
)
def test_without_a_usable_socket_nothing_is_sent(environ):
    assert not Notifier(environ).ready()


def test_a_manager_that_is_gone_is_no_error(tmp_path):
    notifier = Notifier({"NOTIFY_SOCKET": f"{tmp_path}/nobody"})
    assert not notifier.watchdog()
    notifier.close()
    notifier.close()


def test_a_manager_that_never_reads_does_not_block(manager):
    _, environ = manager
    notifier, sent = Notifier(environ), []
    sender = threading.Thread(
        target=lambda: sent.extend(notifier.status("x" * 1000) for _ in range(5000)), daemon=True
    )
    sender.start()
    sender.join(60.0)
    assert not sender.is_alive()
    notifier.close()
    assert sent[0]
    assert not sent[-1]


def test_the_watchdog_time_out_is_in_seconds():
    assert watchdog_interval_s({"WATCHDOG_USEC": "3000000"}) == 3.0
    assert watchdog_interval_s({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "7"}, pid=7) == 3.0


@pytest.mark.parametrize(
    "environ",
    [
        {},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "-5"},
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "²"},
        {"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "8"},
    ],
)
def test_no_time_out_is_none(environ):
    assert watchdog_interval_s(environ, pid=7) is None
