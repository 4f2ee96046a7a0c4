"""The control socket, turn by turn on a manual clock: calls, rude clients, watchers, its end."""

import json
import socket
import threading

import pytest

from thermoctl.errors import NotRunning, Refused, Unavailable
from thermoctl.services.control_client import ControlClient
from thermoctl.services.control_line import OUTBOX, SILENT_S, STUCK_S
from thermoctl.services.control_place import ControlPlace
from thermoctl.services.control_protocol import LONGEST
from thermoctl.services.control_socket import CLIENTS, WATCHERS, ControlSocket
from thermoctl.testing import ManualClock

STATUS = b'{"v":1,"id":1,"do":"status"}\n'


class Answers:
    """Answers as a test wants it: content, a pending reply, or an exception."""

    def __init__(self):
        self.calls, self.reply, self.record_size = [], {"fine": True}, 1

    def answer(self, call):
        self.calls.append(call)
        if isinstance(self.reply, Exception):
            raise self.reply
        return self.reply

    def record(self, cycle):
        return {"t_s": cycle.step.t_s, "more": "x" * self.record_size}

    def details(self, cycle):
        return {"reason": cycle.step.command.reason}


class House:
    """A control socket whose turns a test makes, and the clients of it."""

    def __init__(self, path):
        self.clock, self.answers, self.events = ManualClock(), Answers(), []
        self.path, self.place = path, ControlPlace(path, 0o600)
        self.server = ControlSocket(self.place, self.answers, self._report, self.clock.now_s)
        self.place.open()
        self._clients = []

    def _report(self, name, loop, **fields):
        self.events.append((name, fields))

    def client(self, content=b""):
        client = socket.socket(socket.AF_UNIX)
        self._clients.append(client)
        client.connect(str(self.path))
        client.sendall(content)
        client.settimeout(5.0)
        self.turns()
        return client

    def turns(self, count=1):
        for _ in range(count):
            self.server.turn()

    def close(self):
        for client in self._clients:
            client.close()
        self.server._let_all_go()


@pytest.fixture
def house(tmp_path):
    made = House(tmp_path / "control.sock")
    yield made
    made.close()


def replies(client):
    return [json.loads(line) for line in client.recv(1 << 20).splitlines()]


def error_of(client):
    (reply,) = replies(client)
    assert reply["ok"] is False
    return reply["error"]["code"]


def ended(client):
    """Return whether the other side has closed, once everything it sent is read."""
    try:
        while client.recv(1 << 20):
            pass
    except ConnectionResetError:  # it closed without reading all we sent
        return True
    except TimeoutError:
        return False
    return True


def test_a_call_is_answered_and_the_next_one_too(house):
    client = house.client(STATUS + STATUS.replace(b"1}", b"1}").replace(b'"id":1', b'"id":2'))
    house.turns()
    assert [(each["id"], each["ok"], each["fine"]) for each in replies(client)] == [
        (1, True, True),
        (2, True, True),
    ]


def test_a_line_may_come_in_pieces(house):
    client = house.client(STATUS[:9])
    assert house.answers.calls == []
    client.sendall(STATUS[9:])
    house.turns()
    assert replies(client)[0]["ok"] is True


def test_who_writes_and_closes_its_side_is_answered_before_it_is_let_go(house):
    house.answers.reply = lambda: None
    client = house.client(STATUS)
    client.shutdown(socket.SHUT_WR)
    house.turns(3)
    house.server._pending = {
        line: (call, lambda: {"late": 1}) for line, (call, _) in house.server._pending.items()
    }
    house.turns(2)
    assert replies(client)[0]["late"] == 1
    assert ended(client)


@pytest.mark.parametrize(
    ("content", "code"),
    [(b"\xff\n", "bad_utf8"), (b"{}\n", "bad_version"), (b"\n", "bad_json")],
)
def test_a_bad_line_costs_nothing_but_itself(house, content, code):
    client = house.client(content)
    assert error_of(client) == code
    client.sendall(STATUS)
    house.turns()
    assert replies(client)[0]["ok"] is True


def test_a_line_too_long_is_told_of_and_ends_the_connection(house):
    client = house.client(b"x" * LONGEST)
    assert error_of(client) == "too_long"
    house.turns()
    assert ended(client)
    assert house.client(STATUS).recv(100)


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [(Refused("too hot"), "refused", []), (RuntimeError("a bug"), "failed", ["socket.failed"])],
)
def test_an_answer_that_raises_is_a_reply_and_the_others_are_served(house, error, code, told):
    house.answers.reply = error
    assert error_of(house.client(STATUS)) == code
    assert error_of(house.client(STATUS)) == code
    assert [name for name, _ in house.events] == told  # once, not once a call
    house.answers.reply = {}
    assert replies(house.client(STATUS))[0]["ok"] is True


def test_a_pending_answer_holds_up_its_client_and_nobody_else(house):
    content = []
    house.answers.reply = lambda: content[0] if content else None
    slow = house.client(STATUS)
    house.answers.reply = {"quick": 1}
    assert "quick" in replies(house.client(STATUS))[0]
    content.append({"slow": 1})
    house.turns()
    assert "slow" in replies(slow)[0]


def test_calls_of_one_client_are_answered_one_after_the_other(house):
    content = []
    house.answers.reply = lambda: content[0] if content else None
    client = house.client(STATUS + STATUS.replace(b'"id":1', b'"id":2'))
    house.turns(3)
    assert len(house.answers.calls) == 1
    content.append({"late": 1})
    house.turns(3)
    assert [each["id"] for each in replies(client)] == [1, 2]


def test_who_watches_is_told_of_every_cycle_from_then_on(house, cycle_at):
    house.server.publish(cycle_at(1.0))
    watcher = house.client(b'{"v":1,"id":5,"do":"watch","loop":"tank"}\n')
    for cycle in (cycle_at(2.0), cycle_at(2.5, loop="other"), cycle_at(3.0)):
        house.server.publish(cycle)
    house.turns()
    first, *cycles = replies(watcher)
    assert first["ok"] is True
    assert [(each["id"], each["cycle"]["t_s"]) for each in cycles] == [(5, 2.0), (5, 3.0)]


def test_details_go_to_who_asked_for_them_and_to_nobody_else(house, cycle_at):
    plain = house.client(b'{"v":1,"id":5,"do":"watch"}\n')
    curious = house.client(b'{"v":1,"id":6,"do":"watch","details":true}\n')
    house.server.publish(cycle_at(1.0))
    house.turns(2)
    assert "details" not in replies(plain)[-1]
    assert replies(curious)[-1]["details"] == {"reason": "control"}


def test_a_watcher_that_reads_nothing_is_let_go_at_a_bound(house, cycle_at):
    watcher = house.client(b'{"v":1,"do":"watch"}\n')
    house.answers.record_size = OUTBOX // 4
    for t_s in range(40):
        house.server.publish(cycle_at(float(t_s)))
        house.turns()
        if not house.server._clients:
            break
    print(f"let go after {t_s} records of {OUTBOX // 4} bytes")
    assert house.server._clients == []
    assert ended(watcher)


def test_who_takes_nothing_of_a_little_is_let_go_as_well(house, cycle_at):
    watcher = house.client(b'{"v":1,"do":"watch"}\n')
    house.answers.record_size = 200
    while not house.server._clients[0]._outbox:  # until the kernel's buffer is full
        house.server.publish(cycle_at(1.0))
        house.turns()
    house.clock.advance(STUCK_S + 0.1)
    house.turns()
    assert house.server._clients == []
    assert ended(watcher)


def test_a_silent_client_is_let_go_but_not_one_that_watches_or_waits(house):
    house.answers.reply = lambda: None
    house.client(STATUS)
    house.answers.reply = {}
    house.client(b'{"v":1,"do":"watch"}\n')
    silent, partial = house.client(), house.client(b'{"v":1,')
    house.clock.advance(SILENT_S + 1.0)
    partial.sendall(b'"do"')
    house.turns(2)
    assert len(house.server._clients) == 2
    assert ended(silent)
    assert ended(partial)


def test_who_asks_now_and_then_is_not_taken_for_silent(house):
    client = house.client(STATUS)
    for _ in range(3):
        house.clock.advance(0.8 * SILENT_S)
        client.sendall(STATUS)
        house.turns(2)
    assert len(replies(client)) == 4
    assert len(house.server._clients) == 1


def test_a_newcomer_takes_the_place_of_the_longest_silent(house):
    first = house.client(STATUS)
    for _ in range(CLIENTS - 1):
        house.clock.advance(0.1)
        house.client()
    house.clock.advance(0.1)
    newcomer = house.client(STATUS)
    assert replies(newcomer)[0]["ok"] is True
    assert len(house.server._clients) == CLIENTS
    assert ended(first)


def test_only_some_may_watch_so_that_there_is_always_room_to_ask(house):
    for _ in range(WATCHERS):
        house.client(b'{"v":1,"do":"watch"}\n')
    assert error_of(house.client(b'{"v":1,"do":"watch"}\n')) == "busy"
    for _ in range(2 * CLIENTS):
        assert replies(house.client(STATUS))[0]["ok"] is True
    assert len(house.server._watching) == WATCHERS


def test_while_all_wait_for_the_loop_the_greediest_makes_room(house):
    house.answers.reply = lambda: None
    modest = [house.client(STATUS) for _ in range(CLIENTS - 1)]
    greedy = house.client(STATUS * 50)
    house.turns()
    house.answers.reply = {}
    just_come = house.client()  # has not said anything yet, and may stay
    assert ended(greedy)
    just_come.sendall(STATUS)
    house.turns()
    assert replies(just_come)[0]["ok"] is True
    assert len(house.server._pending) == len(modest)


def test_clients_that_vanish_at_any_moment_leave_nothing_behind(house, cycle_at):
    house.answers.reply = lambda: None
    for content in (b"", b"{", STATUS):
        house.client(content).close()
    house.answers.reply = {}
    house.client(b'{"v":1,"do":"watch"}\n').close()
    house.turns(2)
    house.answers.reply = None
    for client in house.server._clients:
        assert client in house.server._pending  # waits for the loop; its reply finds nobody
    house.server._pending = {
        line: (call, dict) for line, (call, _) in house.server._pending.items()
    }
    house.server.publish(cycle_at(1.0))
    house.turns(3)
    assert (house.server._clients, house.server._pending, house.server._watching) == ([], {}, {})


# -- the thread and the client ---------------------------------------------------------------------


class Told:
    """Events of a thread, for a test to wait for."""

    def __init__(self):
        self.events, self._more = [], threading.Condition()

    def __call__(self, name, loop, **fields):
        with self._more:
            self.events.append((name, fields))
            self._more.notify_all()

    def names(self):
        return [name for name, _ in self.events]

    def wait_for(self, name, count=1):
        with self._more:
            assert self._more.wait_for(lambda: self.names().count(name) >= count, 10.0), self.events


@pytest.fixture
def served(tmp_path):
    """Return a socket with its thread running, its answers, and its events."""
    answers, told = Answers(), Told()
    place = ControlPlace(tmp_path / "control.sock", 0o600)
    server = ControlSocket(place, answers, told)
    server.start()
    told.wait_for("socket.opened")
    yield place.path, answers, told
    server.close()
    assert not place.path.exists()


def test_a_client_asks_is_refused_and_watches(served):
    path, answers, told = served
    assert told.names() == ["socket.opened"]
    with ControlClient(path) as client:
        assert client.ask("status")["fine"] is True
        answers.reply = Refused("expected something else")
        with pytest.raises(Refused, match="something else"):
            client.ask("set", value_c=3.0)
        with pytest.raises(Refused, match="one of status"):
            client.ask("explode")
    assert answers.calls[1].argument == 3.0


def test_a_client_that_gets_no_reply_says_how_long_it_waited(served):
    path, answers, _ = served
    answers.reply = lambda: None
    with ControlClient(path) as client, pytest.raises(Unavailable, match="within"):
        client.ask("status", 0.1)


def test_no_daemon_is_told_with_the_place_that_was_tried(tmp_path):
    with pytest.raises(NotRunning, match="a running daemon at"):
        ControlClient(tmp_path / "control.sock")


def test_a_thread_that_crashes_is_an_event_and_the_socket_is_opened_again(tmp_path, monkeypatch):
    monkeypatch.setattr("thermoctl.services.control_socket.RETRY_S", 0.01)
    told, crashes = Told(), iter([RuntimeError("a bug")] * 2)
    place = ControlPlace(tmp_path / "control.sock", 0o600)
    server = ControlSocket(place, Answers(), told)
    turn = server.turn

    def crashing():
        for crash in crashes:
            raise crash
        turn()

    monkeypatch.setattr(server, "turn", crashing)
    server.start()
    try:
        told.wait_for("socket.opened", 3)
        with ControlClient(place.path) as client:
            assert client.ask("status")["fine"] is True
    finally:
        server.close()
    failed = [fields for name, fields in told.events if name == "socket.failed"]
    assert "a bug" in failed[0]["error"]
    assert "Traceback" in failed[0]["trace"]


def test_a_place_that_is_taken_is_told_of_once_and_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr("thermoctl.services.control_socket.RETRY_S", 0.01)
    first = ControlPlace(tmp_path / "control.sock", 0o600)
    first.open()
    told = Told()
    second = ControlPlace(first.path, 0o600)
    server = ControlSocket(second, Answers(), told)
    server.start()
    try:
        told.wait_for("socket.unavailable")
        first.close()
        told.wait_for("socket.opened")
    finally:
        server.close()
    assert told.names() == ["socket.unavailable", "socket.opened"]


def test_a_socket_that_something_removed_is_opened_again(tmp_path, monkeypatch):
    monkeypatch.setattr("thermoctl.services.control_socket.RETRY_S", 0.01)
    told, place = Told(), ControlPlace(tmp_path / "control.sock", 0o600)
    server = ControlSocket(place, Answers(), told)
    server.start()
    try:
        told.wait_for("socket.opened")
        place.path.unlink()
        told.wait_for("socket.opened", 2)
        with ControlClient(place.path) as client:
            assert client.ask("status")["fine"] is True
    finally:
        server.close()
    assert told.names() == ["socket.opened", "socket.unavailable", "socket.opened"]
