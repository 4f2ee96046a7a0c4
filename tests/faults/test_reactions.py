"""From a fault to power 0 at the board: the real loop and regulator on simulated time.

Every test prints what it measured, in seconds from the fault to the moment from which no power is
given any more.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar

import pytest

from thermoctl.app.compose import loop_for, regulator_for
from thermoctl.app.live.desk import Desk
from thermoctl.app.live.keys import Action
from thermoctl.app.live.model import Facts
from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.app.simulate import wired
from thermoctl.errors import ConfigError, FaultError, LinkError, Refused
from thermoctl.estimation import Identifier
from thermoctl.model.actuator import Linear
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.plant.parameters import TankParameters
from thermoctl.regulator import Regulator
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import EXCHANGE_S, Loop, Wiring
from thermoctl.signals import Beliefs, Cycle, Estimate, Quality, RawSample, SetPoint, State
from thermoctl.testing import FaultyLink, LockStepLink, ManualClock, ScriptedBoard
from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.thermodaq import ThermoDaq, ThermoDaqSettings
from thermoctl_drivers.thermodaq_board import BoardModel

CONFIG = Path(__file__).parents[2] / "config"
TABLE = {"setpoint_c": 37.5, "trip_above_c": 60.0, "trip_below_c": 0.0, "mode": "auto"}
COLD = 600.0  # counts of 1024 at 5 V: 19.8 degC


def told(fault: int, name: str, seconds: float) -> None:
    print(f"fault {fault}, {name}: power 0 after {seconds:.2f} s")


# -- a simulated tank on a simulated board ---------------------------------------------------------


class Tank:
    """The aquarium at its set point, with its loop; a second is a cycle."""

    def __init__(self, settled_s: int = 300, **keys: object) -> None:
        settings = load(CONFIG / "aquarium.toml")
        board = settings.boards["daq"].model_copy(update={"initial_c": 37.5})
        table = settings.loops["tank"].model_copy(update=keys)
        settings = settings.model_copy(update={"boards": {"daq": board}, "loops": {"tank": table}})
        self.clock, self.cycles = ManualClock(), list[Cycle]()
        self.loop = loop_for(settings, self.clock, self.cycles.append, beside=False)
        self.run(settled_s)
        assert self.cycles[-1].step.state is State.RUN

    @property
    def board(self) -> Any:
        return self.loop.boards[0].board

    @property
    def last(self) -> Cycle:
        return self.cycles[-1]

    def run(self, seconds: int) -> None:
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())

    def seconds_to_power_0(self, at_most: int = 100) -> float:
        """Return how long it takes from now until the board has taken power 0."""
        began_s = self.clock.now_s()
        for _ in range(at_most):
            self.run(1)
            if self.last.accepted_power == 0.0:
                return self.clock.now_s() - began_s
        raise AssertionError(f"still at {self.last.accepted_power} after {at_most} s")

    def events(self) -> list[str]:
        return [event.name for cycle in self.cycles for event in cycle.step.events]


@pytest.mark.parametrize(("fault", "name"), [(1, "open"), (2, "short")])
def test_a_broken_sensor_circuit_is_safe_in_two_seconds(fault: int, name: str) -> None:
    tank = Tank()
    tank.board.disturb(name, 20.0)
    seconds = tank.seconds_to_power_0()
    told(fault, f"sensor {name}", seconds)
    assert seconds <= 2.0
    assert tank.last.step.state is State.SAFE
    assert f"sensor.{name}" in tank.events()


def test_a_sensor_that_opens_three_times_in_ten_minutes_latches() -> None:
    tank = Tank()
    for _ in range(3):
        tank.board.disturb("open", 2.0)
        tank.run(120)
    assert tank.last.step.state is State.LATCHED
    tank.run(300)
    assert tank.last.accepted_power == 0.0


@pytest.mark.parametrize("spike_k", [50.0, -50.0])
def test_a_spike_below_the_hard_limit_is_counted_and_hardly_moves_the_output(
    spike_k: float,
) -> None:
    tank = Tank(settled_s=300, trip_above_c=95.0)
    before = tank.last.step.command.power
    tank.board.disturb("spike", spike_k)
    tank.run(2)
    moved = max(abs(cycle.step.command.power - before) for cycle in tank.cycles[-2:])
    print(f"fault 6, a spike of {spike_k:+g} K: the output moved by {moved:.3f}")
    assert moved <= 0.05
    assert tank.events().count("sensor.spike") == 1


def test_above_the_hard_limit_the_first_reading_cuts_and_the_second_latches() -> None:
    tank = Tank()
    tank.board.disturb("spike", 40.0)
    seconds = tank.seconds_to_power_0()
    told(9, "above the hard limit", seconds)
    assert seconds == 1.0  # the first sample there is
    assert tank.last.step.state is not State.LATCHED
    tank.run(1)
    assert tank.last.accepted_power > 0.0  # a spike costs one cycle
    for _ in range(2):
        tank.board.disturb("spike", 40.0)
        tank.run(1)
    assert tank.last.step.state is State.LATCHED


def test_a_lost_sensor_is_ridden_for_a_minute_at_most_then_safe() -> None:
    tank = Tank()
    tank.board.disturb("dropout", 1000.0)
    holding = tank.last.step.beliefs.holding_power
    tank.run(1)
    assert tank.last.step.state is State.RIDE
    assert holding is not None
    assert 0.0 < tank.last.accepted_power <= holding + 1e-3
    seconds = 1.0 + tank.seconds_to_power_0()
    told(16, "no samples, model known", seconds)
    assert seconds <= 60.0
    assert tank.last.step.state is State.SAFE


# -- the thermodaq board behind a line that fails --------------------------------------------------


class Line:
    """A device that lives with the clock, whoever is connected, and may answer late or wrongly."""

    def __init__(self, clock: ManualClock) -> None:
        self.board = BoardModel(1)
        self.device = wired(self.board, TankParameters(initial_c=37.5))
        self.late_s, self.late = 0.0, b""
        self.refuses = b""
        self._clock = clock
        self._coming: deque[tuple[float, bytes]] = deque()
        self._begun = b""

    def send(self, data: bytes) -> None:
        if self.refuses and data[4:5] == self.refuses:  # a command that no board knows: NAK
            body = frames.body_of(data, b">")
            data = frames.frame(b">", body.replace(b" %b " % self.refuses, b" V "))
        self.device.send(data)

    def advance(self, seconds: float) -> None:
        del seconds
        self.catch_up()

    def catch_up(self) -> None:
        self.device.advance(max(self._clock.now_s() - self.device.t_s, 0.0))
        *lines, self._begun = (self._begun + self.device.receive()).split(b"\n")
        for line in lines:
            wait_s = self.late_s if line[4:5] == self.late else 0.0
            self._coming.append((self._clock.now_s() + wait_s, line + b"\n"))

    def receive(self) -> bytes:
        due = [each for each in self._coming if each[0] <= self._clock.now_s()]
        self._coming = deque(each for each in self._coming if each not in due)
        return b"".join(line for _, line in due)


class Rig:
    """A loop on a thermodaq board at its set point."""

    def __init__(self, settled_s: int = 300) -> None:
        self.clock = ManualClock()
        self.line = Line(self.clock)
        self.link: FaultyLink
        self.fault = "healthy"
        self.cycles: list[Cycle] = []
        self.built = 0
        reports: list[Any] = []
        table = TABLE | {"model": {"gain_k_per_s": 0.0449}}
        self.connection = Connection(
            "daq", self._build, self.clock, lambda *a, **k: reports[0](*a, **k), beside=False
        )
        wiring = Wiring(
            "tank",
            regulator_for(load({"loops": {"tank": table}})),
            *(self.connection, "temperature", Sensor(LM335, 5.0)),
            *(self.connection, "heater", Linear()),
        )
        self.loop = Loop([wiring], self.clock, 1.0, self.cycles.append)
        reports.append(self.loop.report)
        self._deadline_s = 0.0
        self.run(settled_s)
        assert self.last.step.state is State.RUN
        assert 0.02 < self.last.accepted_power < 0.9

    def _build(self) -> ThermoDaq:
        self.built += 1
        if self.fault == "unplugged":
            raise LinkError("no such port")
        self.link = FaultyLink(LockStepLink(self.line, self.clock), self.clock)
        self.link.fault = self.fault
        return ThermoDaq(ThermoDaqSettings(port="simulated"), self.link, self.clock)

    @property
    def last(self) -> Cycle:
        return self.cycles[-1]

    def run(self, seconds: int) -> None:
        for _ in range(seconds):
            self._deadline_s += 1.0
            self.clock.sleep_until(self._deadline_s)
            self.loop.cycle(self._deadline_s)

    def breaks(self, fault: str) -> None:
        self.fault = self.link.fault = fault

    def seconds_to_power_0(self, within_s: int) -> float:
        """Let `within_s` pass; return when the heater went off for good, from now on."""
        self.line.catch_up()
        began_s = self.line.board.t_s
        self.run(within_s)
        self.line.catch_up()
        on_s = self.line.board.on_s
        self.run(5)
        self.line.catch_up()
        assert self.line.board.on_s == on_s, "the heater is on still"
        return max(self.line.board.off_since_s - began_s, 0.0)

    def events(self) -> list[str]:
        return [event.name for cycle in self.cycles for event in cycle.step.events]


def test_an_unplugged_board_cuts_by_itself_and_is_taken_back_at_power_0() -> None:
    rig = Rig()
    rig.breaks("unplugged")
    seconds = rig.seconds_to_power_0(10)
    told(13, "board unplugged", seconds)
    assert seconds <= 3.0
    assert rig.last.step.state is State.SAFE
    rig.breaks("healthy")
    rig.run(31)  # the longest pause between two attempts, and one cycle
    assert rig.events().count("board.opened") == 2
    assert rig.last.step.measurement.quality is Quality.GOOD
    rig.run(32)
    assert rig.last.step.state is State.RUN
    assert rig.last.accepted_power > 0.0


def test_a_late_reply_is_ridden_and_never_taken_for_the_next() -> None:
    rig = Rig(settled_s=300)  # until the power that holds is known
    before = len(rig.cycles)
    rig.line.late, rig.line.late_s = b"R", 0.6
    seconds = rig.seconds_to_power_0(62)
    told(16, "replies 0.6 s late", seconds)
    late = rig.cycles[before:]
    assert late[0].step.state is State.RIDE
    assert seconds <= 60.0 + 2 * EXCHANGE_S
    assert late[-1].step.state is State.SAFE
    assert {cycle.step.measurement.quality for cycle in late} == {Quality.MISSING}
    board = rig.connection.board
    assert board is not None
    assert board.health().counters["dropped"] > 0


def test_replies_that_come_again_are_the_new_ones() -> None:
    rig = Rig()
    rig.line.late, rig.line.late_s = b"R", 0.6
    rig.run(5)
    rig.line.late_s = 0.0
    rig.run(2)
    measured = rig.last.step.measurement
    assert measured.quality is Quality.GOOD
    assert rig.clock.now_s() - measured.t_s < 0.5


def test_garbled_replies_are_asked_for_once_more_and_then_are_no_readings() -> None:
    rig = Rig()
    rig.breaks("garbage")
    written = rig.link.written
    rig.run(1)
    tries = rig.link.written - written
    print(f"fault 17: {tries} requests in the cycle, reads and writes together")
    assert tries == 2 + 3  # one retry of the read, two of the write
    seconds = 1.0 + rig.seconds_to_power_0(10)
    told(17, "replies garbled", seconds)
    assert seconds <= 4.0


def test_a_refused_write_is_repeated_twice_and_safe_in_three_seconds() -> None:
    rig = Rig()
    rig.line.refuses = b"W"
    written = rig.link.written
    rig.run(1)
    tries = rig.link.written - written - 1  # less the read
    seconds = 1.0 + rig.seconds_to_power_0(10)
    told(22, f"write refused, {tries} attempts", seconds)
    assert tries == 3
    assert seconds <= 3.0
    assert rig.last.step.state is State.SAFE


def test_a_board_that_gives_another_power_than_it_took_is_safe_in_two_cycles() -> None:
    rig = Rig()
    began = len(rig.cycles)
    output = rig.line.board._output
    taken = output.command

    def disobey(power: int, valid_ms: int, now_us: int) -> int:
        answer = taken(power, valid_ms, now_us)
        output.power = min(output.power + 3000, 10_000) if power else 0
        return answer

    output.command = disobey  # type: ignore[method-assign]
    seconds = rig.seconds_to_power_0(6)
    told(25, "the board gives 30 % more than it took", seconds)
    states = [cycle.step.state for cycle in rig.cycles[began:]]
    assert states.index(State.SAFE) <= 2
    assert "board.fault" in rig.events()


# -- what a script can do --------------------------------------------------------------------------


class Bench:
    """A loop on scripted boards."""

    def __init__(self, board: ScriptedBoard, clock: ManualClock, regulator: Regulator) -> None:
        self.board, self.clock, self.cycles = board, clock, list[Cycle]()
        reports: list[Any] = []
        connection = Connection(
            "daq", lambda: board, clock, lambda *a, **k: reports[0](*a, **k), beside=False
        )
        wiring = Wiring(
            "tank",
            regulator,
            *(connection, "temperature", Sensor(LM335, 5.0)),
            *(connection, "heater", Linear()),
        )
        self.loop = Loop([wiring], clock, 1.0, self.cycles.append)
        reports.append(self.loop.report)

    def run(self, seconds: int) -> None:
        self.loop.run(until_s=self.clock.now_s() + seconds - 0.5)

    def seconds_to_power_0(self, broken_s: float) -> float:
        """Return when power 0 was written for good, from `broken_s` on; none may follow."""
        writes = [write for write in self.board.written if write.t_s >= broken_s]
        zeros = [write.outputs["heater"] == 0.0 for write in writes]
        assert zeros[-1], "the heater is on still"
        last_on = max((n for n, zero in enumerate(zeros) if not zero), default=-1)
        return writes[last_on + 1].t_s - broken_s


def plain(**keys: object) -> Regulator:
    return regulator_for(load({"loops": {"tank": TABLE | {"controller": "on-off"} | keys}}))


def test_an_output_that_takes_more_than_commanded_is_safe_in_two_cycles() -> None:
    clock = ManualClock()
    warm = 640.0  # 39.4 degC: the command is 0
    board = ScriptedBoard(clock, [warm], [0.0, 0.0, 0.5])
    bench = Bench(board, clock, plain())
    bench.run(5)
    states = [cycle.step.state for cycle in bench.cycles]
    cycles = states.index(State.SAFE) - 2
    print(f"fault 25: SAFE {cycles} cycles after the output took more than it was told")
    assert cycles <= 2
    assert "output.readback" in [e.name for c in bench.cycles for e in c.step.events]


def test_an_output_that_does_not_say_what_it_took_is_no_output_at_0() -> None:
    clock = ManualClock()
    board = ScriptedBoard(clock, [COLD], [None, None, math.nan])
    bench = Bench(board, clock, plain())
    bench.run(6)
    told(25, "read-back missing", bench.seconds_to_power_0(2.0))
    assert math.isnan(bench.cycles[2].accepted_power)
    assert bench.cycles[-1].step.state is State.SAFE


@dataclass(frozen=True)
class Poison:
    """A controller, or a law of estimation, that turns bad after a while."""

    value: Any
    after_s: float = 3.0
    name: ClassVar[str] = "poison"

    def start(self) -> None:
        return None

    def observe(self, belief: None, situation: Any) -> None:
        return None

    def ride_s(self, belief: None) -> float:
        return 0.0

    def remarks(self, belief: None) -> dict[str, str]:
        return {}

    def beliefs(self, belief: None, situation: Any) -> Beliefs:
        return Beliefs()

    def decide(self, belief: None, situation: Any) -> tuple[None, float]:
        return None, 0.6 if situation.t_s < self.after_s else self._result()

    def update(self, belief: Estimate, phi: Any, y: float) -> Estimate:
        count = belief.P[0, 0] + 1.0
        if count <= self.after_s + 1.0:
            return Estimate(belief.theta, belief.P + 1.0, 0.0, 1.0)
        return Estimate(belief.theta * self._result(), belief.P, 0.0, 1.0)

    def _result(self) -> Any:
        if isinstance(self.value, BaseException):
            raise self.value
        return self.value


def poisoned(part: str, value: Any) -> Regulator:
    plan = plan_for(load({"loops": {"tank": TABLE}}).loops["tank"])
    if part == "controller":
        return Regulator(replace(plan, controller=Poison(value)))
    law = Poison(value)
    return Regulator(
        replace(plan, identifier=Identifier(plan.identifier.structure, law, (1.0,), 1.0))
    )


@pytest.mark.parametrize("part", ["controller", "estimator"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, OverflowError("too large")])
def test_what_is_no_number_is_power_0_in_the_same_cycle(part: str, value: Any) -> None:
    clock = ManualClock()
    board = ScriptedBoard(clock, [COLD])
    bench = Bench(board, clock, poisoned(part, value))
    bench.run(12)
    seconds = bench.seconds_to_power_0(3.0)
    told(11, f"{value!r} from the {part}", seconds)
    assert board.written[3].outputs["heater"] > 0.0
    assert seconds == 0.0
    assert bench.cycles[-1].step.state is State.SAFE
    assert math.isfinite(bench.cycles[-1].step.estimate.theta[0])


@pytest.mark.parametrize(
    ("reads", "writes"),
    [
        ([COLD, COLD, COLD, ZeroDivisionError("read")], [None]),
        ([COLD, COLD, COLD, MemoryError()], [None]),
        ([COLD, COLD, COLD, {"temperature": None}, {"temperature": "hot"}], [None]),
        ([COLD, COLD, COLD, {"temperature": RawSample(0.0, COLD, 1024.0)}], [None]),
        ([COLD], [None, None, None, KeyError("write"), None]),
    ],
    ids=["read", "memory", "no sample", "frozen sample", "write"],
)
def test_a_driver_that_raises_or_answers_nonsense_gets_no_heat(
    reads: list[Any], writes: list[Any]
) -> None:
    clock = ManualClock()
    board = ScriptedBoard(clock, reads, writes)
    bench = Bench(board, clock, plain())
    bench.run(12)
    seconds = bench.seconds_to_power_0(3.0)
    told(58, f"driver, {reads[-1]!r} {writes[-1]!r}", seconds)
    assert seconds <= 3.0
    assert bench.cycles[-1].step.state is State.SAFE
    assert len(bench.cycles) == 12  # what failed is published, too


def test_an_exception_in_a_driver_or_a_law_is_power_0_in_the_same_cycle() -> None:
    clock = ManualClock()
    board = ScriptedBoard(clock, [COLD, COLD, COLD, RuntimeError("bug")])
    bench = Bench(board, clock, plain())
    bench.run(8)
    seconds = bench.seconds_to_power_0(3.0)
    told(58, "exception in a driver", seconds)
    assert seconds == 0.0
    events = [event for cycle in bench.cycles for event in cycle.step.events]
    traces = [str(event.fields["trace"]) for event in events if "trace" in event.fields]
    assert len(traces) == 1  # said once, not every second
    assert "bug" in traces[0]


# -- set points, by every way in -------------------------------------------------------------------

BAD = ["nan", "inf", "1e400", "-1e400", "1000.0", '"warm"', "true", "[37.0]"]


@pytest.mark.parametrize("text", BAD)
def test_a_bad_set_point_in_a_file_is_refused_naming_the_key(text: str, tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    whole = (CONFIG / "aquarium.toml").read_text()
    file.write_text(whole.replace("setpoint_c = 37.5", f"setpoint_c = {text}"))
    with pytest.raises(ConfigError, match="setpoint_c"):
        load(file)


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, -math.inf, 1e400, 1000.0, "warm", None, True]
)
def test_a_bad_set_point_put_into_the_queue_is_refused_and_the_old_one_stays(value: Any) -> None:
    tank = Tank(settled_s=5)
    tank.loop.ask(SetPoint(value))
    tank.run(1)
    refused = [e for e in tank.last.step.events if e.name == "request.refused"]
    assert "5 to 55" in str(refused[0].fields["why"])
    assert tank.last.step.setpoint_c == 37.5
    with pytest.raises(Refused, match="5 to 55"):
        tank.loop.wirings[0].regulator.request(SetPoint(value))


@pytest.mark.parametrize("setpoint_c", [math.nan, math.inf, -math.inf, 1e308, 5.0, 55.0])
def test_no_key_of_the_live_view_asks_for_a_set_point_out_of_range(setpoint_c: float) -> None:
    desk = Desk(Facts("tank", 1.0, 5.0, 55.0, datetime.now(UTC)))
    tank = Tank(settled_s=2)
    step = replace(tank.last.step, setpoint_c=setpoint_c)
    keys = [each for each in Action if each.name.startswith("SETPOINT")]
    assert len(keys) == 4
    for action in keys * 20:
        request = desk.press(action, step)
        if request is None:  # at the limit there is nothing left to ask for
            continue
        assert isinstance(request, SetPoint)
        assert 5.0 <= request.value_c <= 55.0
        tank.loop.wirings[0].regulator.request(request)


def test_a_request_for_a_loop_that_is_not_there_is_answered() -> None:
    tank = Tank(settled_s=5)
    tank.loop.ask(SetPoint(40.0), "tunk")
    tank.run(1)
    refused = [e for e in tank.last.step.events if e.name == "request.refused"]
    assert "tunk" in str(refused[0].fields["why"])
    assert tank.last.step.setpoint_c == 37.5


# -- silence ---------------------------------------------------------------------------------------


def test_a_fault_that_a_board_reports_when_it_is_read_is_safe_at_once() -> None:
    clock = ManualClock()
    board = ScriptedBoard(clock, [COLD, COLD, COLD, FaultError("output differs")])
    bench = Bench(board, clock, plain())
    bench.run(8)
    seconds = bench.seconds_to_power_0(3.0)
    told(25, "the board reports a fault", seconds)
    assert seconds == 0.0
