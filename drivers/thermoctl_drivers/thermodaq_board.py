"""The thermodaq board without its chip: its behaviour in Python.

It answers byte for byte as the firmware does (the same tests run against both), so that the board
can be simulated where no AVR compiler or chip simulator is installed. There is no zero-cross input:
with phase angle chosen it does what the firmware does with that input open, whole-cycle bursts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.thermodaq_frames import Cut, Flag, FrameError, Refusal

VERSION = "1.0.0"
LINE_MAX = 48
CONVERSIONS_PER_PERIOD = 32

_BYTE_US = 87
_NEVER_US = 1 << 62
_RING = 127
_REFERENCE_MV = 5000.0
_ARGUMENTS_MAX = 5
_PHASE_LEAST = frames.FULL_POWER // 100
_TIMER_HZ = 2_000_000  # of the timer that paces conversions


@dataclass(frozen=True, slots=True)
class Configuration:
    """What ``C`` sets, in the order of its arguments."""

    phase_angle: int = 0
    mains_hz: int = 50
    periods: int = 2
    dead_man_ms: int = 2500
    power_max: int = 0

    @property
    def acceptable(self) -> bool:
        """Whether every argument is in its range."""
        return (
            self.phase_angle in (0, 1)
            and self.mains_hz in (50, 60)
            and 1 <= self.periods <= 50
            and 200 <= self.dead_man_ms <= 10_000
            and self.power_max <= frames.FULL_POWER
        )

    @property
    def cycle_us(self) -> int:
        """One mains period of the board's own time base, a whole number of timer counts."""
        rate = self.mains_hz * CONVERSIONS_PER_PERIOD
        counts = (_TIMER_HZ + rate // 2) // rate
        return counts * CONVERSIONS_PER_PERIOD * 1_000_000 // _TIMER_HZ


class _RefusedError(Exception):
    """A command that is not obeyed, and why."""

    def __init__(self, reason: Refusal) -> None:
        super().__init__(reason.name)
        self.reason = reason


class Output:
    """The heater output: bursts of whole cycles, a cap, and the dead-man."""

    def __init__(self, chosen: Configuration, now_us: int, cut: Cut) -> None:
        self.power, self.cut, self.level = 0, cut, False
        self.expires_us = _NEVER_US
        self.next_cycle_us = now_us + chosen.cycle_us
        self._chosen = chosen
        self._sum = 0

    def command(self, power: int, valid_ms: int, now_us: int) -> int:
        """Take `power`, capped, for at most `valid_ms`; return what was taken."""
        power = min(power, self._chosen.power_max)
        if self._chosen.phase_angle and power < _PHASE_LEAST:
            power = 0
        if power == 0:
            self.level, self._sum = False, 0
        self.power, self.cut = power, Cut.NONE
        self.expires_us = now_us + 1000 * valid_ms
        return power

    def expire(self) -> None:
        """Cut: no fresh command came."""
        if self.power:
            self.cut = Cut.DEAD_MAN
        self.power, self._sum, self.level, self.expires_us = 0, 0, False, _NEVER_US

    def begin_cycle(self) -> None:
        """Spread the power over whole cycles, as evenly as they go."""
        self.next_cycle_us += self._chosen.cycle_us
        self._sum += self.power
        self.level = self.power > 0 and self._sum >= frames.FULL_POWER
        if self.level:
            self._sum -= frames.FULL_POWER


class Converter:
    """The analog input: bursts over whole mains periods, 10 bits, noise, pickup."""

    def __init__(self, seed: int) -> None:
        self.millivolts = 0.0
        self.noise_mv = self.pickup_mv = 0.0
        self.mains_hz = 50.0
        self.total = self.count = self.sequence = 0
        self.middle_us = self.ends_us = 0
        self._rng = np.random.default_rng(seed)
        self._length_us = 1
        self._conversions = 1

    def begin(self, chosen: Configuration, now_us: int) -> None:
        """Forget the last burst and begin a new one."""
        self._conversions = chosen.periods * CONVERSIONS_PER_PERIOD
        self._length_us = chosen.periods * chosen.cycle_us
        self.total = self.count = 0
        self.ends_us = now_us + self._length_us

    def finish(self) -> None:
        """Publish the burst that ends now and begin the next."""
        fractions = (np.arange(self._conversions) + 0.5) / self._conversions
        t_s = (self.ends_us - self._length_us * (1.0 - fractions)) * 1e-6
        mv = self.millivolts + self.noise_mv * self._rng.standard_normal(self._conversions)
        mv += self.pickup_mv * np.sin(2.0 * np.pi * self.mains_hz * t_s)
        counts = np.floor(np.maximum(np.rint(mv), 0.0) * 1024.0 / _REFERENCE_MV)
        self.total = int(np.minimum(counts, 1023.0).sum())
        self.count = self._conversions
        self.sequence = (self.sequence + 1) & 0xFFFF
        self.middle_us = self.ends_us - self._length_us // 2
        self.ends_us += self._length_us


class BoardModel:
    """The whole board, moved on by `advance` alone.

    Parameters
    ----------
    seed : int
        Of the noise on the analog input.
    """

    def __init__(self, seed: int = 1) -> None:
        self._now_us = 0
        self._on_us = 0
        self._off_since_us = 0
        self._unit = 0
        self._converter = Converter(seed)
        self._reset_cause = 1
        self._start()

    def _start(self) -> None:
        """Do what the firmware does at power-on."""
        self._chosen = Configuration()
        self._output = Output(self._chosen, self._now_us, Cut.RESET)
        self._converter.sequence = 0
        self._converter.begin(self._chosen, self._now_us)
        self._reset_seen, self._configured = True, False
        self._line: bytearray | None = None
        self._incoming, self._outgoing, self._sent = bytearray(), bytearray(), bytearray()
        self._next_in_us = self._next_out_us = _NEVER_US

    # -- the world around the chip ---------------------------------------------------------------

    @property
    def t_s(self) -> float:
        """Time since power-on in s."""
        return self._now_us * 1e-6

    @property
    def on_s(self) -> float:
        """How long the heater pin has been high, in all, in s."""
        return self._on_us * 1e-6

    @property
    def off_since_s(self) -> float:
        """When the heater pin went low the last time, in s."""
        return self._off_since_us * 1e-6

    @property
    def level(self) -> bool:
        """Whether the heater pin is high."""
        return self._output.level

    def analog(
        self,
        millivolts: float,
        noise_mv: float = 0.0,
        pickup_mv: float = 0.0,
        mains_hz: float = 50.0,
    ) -> None:
        """Put `millivolts` on the analog input, with noise and a sine of the mains."""
        each = self._converter
        each.millivolts, each.noise_mv = millivolts, noise_mv
        each.pickup_mv, each.mains_hz = pickup_mv, mains_hz

    def reset(self) -> None:
        """Pull the reset pin."""
        was_on = self._output.level
        self._reset_cause = 0
        self._start()
        if was_on:
            self._off_since_us = self._now_us

    def send(self, data: bytes) -> None:
        """Put bytes on the line to the board; they arrive at 115200 baud."""
        if data and not self._incoming:
            self._next_in_us = self._now_us + _BYTE_US
        self._incoming += data

    def receive(self) -> bytes:
        """Return what the board has sent since the last call."""
        received = bytes(self._sent)
        self._sent.clear()
        return received

    def close(self) -> None:
        """Nothing to let go."""

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        end_us = self._now_us + round(seconds * 1e6)
        while self._now_us < end_us:
            due_us = min(
                end_us,
                self._next_in_us,
                self._next_out_us,
                self._output.expires_us,
                self._output.next_cycle_us,
                self._converter.ends_us,
            )
            was_on = self._output.level
            self._on_us += was_on * (due_us - self._now_us)
            self._now_us = due_us
            self._do_what_is_due()
            if was_on and not self._output.level:
                self._off_since_us = self._now_us

    def _do_what_is_due(self) -> None:
        now_us = self._now_us
        if now_us == self._next_out_us:
            self._sent.append(self._outgoing.pop(0))
            self._next_out_us = now_us + _BYTE_US if self._outgoing else _NEVER_US
        if now_us == self._converter.ends_us:
            self._converter.finish()
        if now_us == self._output.expires_us:
            self._output.expire()
        if now_us == self._output.next_cycle_us:
            self._output.begin_cycle()
        if now_us == self._next_in_us:
            byte = self._incoming.pop(0)
            self._next_in_us = now_us + _BYTE_US if self._incoming else _NEVER_US
            self._take(byte)

    # -- the protocol ----------------------------------------------------------------------------

    def _take(self, byte: int) -> None:
        """Collect a line; a start character begins one anew, a long one is dropped."""
        if byte == ord(">"):
            self._line = bytearray()
        elif self._line is None or byte == ord("\r"):
            return
        elif byte == ord("\n"):
            line, self._line = bytes(self._line), None
            self._finish_line(line)
        elif len(self._line) < LINE_MAX:
            self._line.append(byte)
        else:
            self._line = None
            self._reply(frames.UNKNOWN_SENDER, "E", Refusal.TOO_LONG)

    def _finish_line(self, line: bytes) -> None:
        """Obey one line, or say why not."""
        sequence = frames.UNKNOWN_SENDER
        try:
            body = _body(line)
            sequence = body[:2].decode("ascii")
            self._obey(sequence, chr(body[3]), _arguments(body[4:]))
        except _RefusedError as refused:
            self._reply(sequence, "E", refused.reason)

    def _obey(self, sequence: str, letter: str, arguments: tuple[int, ...]) -> None:
        commands: dict[str, tuple[int, Callable[..., tuple[object, ...]]]] = {
            "H": (0, self._hello),
            "C": (5, self._configure),
            "R": (0, self._read),
            "W": (2, self._write),
            "U": (1, self._set_unit),
        }
        if letter not in commands:
            raise _RefusedError(Refusal.COMMAND)
        count, obey = commands[letter]
        if len(arguments) != count:
            raise _RefusedError(Refusal.ARGUMENTS)
        self._reply(sequence, letter, *obey(*arguments))

    def _hello(self) -> tuple[object, ...]:
        flags = self._flags()
        self._reset_seen = False
        who = (frames.PRODUCT, frames.PROTOCOL, VERSION, self._unit, self._reset_cause)
        return (*who, f"{flags:02X}")

    def _configure(self, *arguments: int) -> tuple[object, ...]:
        chosen = Configuration(*arguments)
        if not chosen.acceptable:
            raise _RefusedError(Refusal.RANGE)
        self._chosen, self._configured = chosen, True
        self._output = Output(chosen, self._now_us, Cut.CONFIGURED)
        self._converter.begin(chosen, self._now_us)
        return arguments

    def _read(self) -> tuple[object, ...]:
        each = self._converter
        age_ms = (self._now_us - each.middle_us) // 1000 if each.count else 0
        state = (self._output.power, int(self._output.cut), f"{self._flags():02X}")
        return (each.total, each.count, each.sequence, age_ms, *state)

    def _write(self, power: int, valid_ms: int) -> tuple[object, ...]:
        if power > frames.FULL_POWER or valid_ms == 0:
            raise _RefusedError(Refusal.RANGE)
        if power and not self._configured:
            raise _RefusedError(Refusal.UNCONFIGURED)
        valid_ms = min(valid_ms, self._chosen.dead_man_ms)
        taken = self._output.command(power, valid_ms, self._now_us)
        return (taken, valid_ms, f"{self._flags():02X}")

    def _set_unit(self, number: int) -> tuple[object, ...]:
        if self._output.power:
            raise _RefusedError(Refusal.HEATING)
        if number == 0xFFFF:
            raise _RefusedError(Refusal.RANGE)
        self._unit = number
        return (number,)

    def _flags(self) -> Flag:
        flags = Flag(0)
        if self._reset_seen:
            flags |= Flag.RESET
        if not self._configured:
            flags |= Flag.UNCONFIGURED
        if self._output.cut is Cut.DEAD_MAN:
            flags |= Flag.CUT
        if self._output.power:
            flags |= Flag.HEATING
        return flags

    def _reply(self, sequence: str, letter: str, *fields: object) -> None:
        words = [sequence, letter]
        words += [str(int(each)) if isinstance(each, int) else str(each) for each in fields]
        line = frames.frame(b"<", " ".join(words).encode("ascii"))
        if len(self._outgoing) + len(line) > _RING:
            return  # no room: lost, never waited for
        if not self._outgoing:
            self._next_out_us = self._now_us + _BYTE_US
        self._outgoing += line


def _body(line: bytes) -> bytes:
    """Return what `line` carries between its start character and the star."""
    if len(line) < 9 or line[-5:-4] != b"*" or any(c not in b"0123456789ABCDEF" for c in line[-4:]):
        raise _RefusedError(Refusal.MALFORMED)
    try:
        body = frames.body_of(b">" + line, b">")
    except FrameError as error:
        raise _RefusedError(Refusal.CHECKSUM) from error
    if any(c not in b"0123456789ABCDEF" for c in body[:2]) or body[2:3] != b" ":
        raise _RefusedError(Refusal.MALFORMED)
    return body


def _arguments(text: bytes) -> tuple[int, ...]:
    """Return decimal arguments of 1 to 5 digits, each after one space."""
    words = text.split(b" ")
    if words[0] or len(words) - 1 > _ARGUMENTS_MAX:
        raise _RefusedError(Refusal.ARGUMENTS)
    for word in words[1:]:
        if not 1 <= len(word) <= 5 or not word.isdigit() or int(word) > 0xFFFF:
            raise _RefusedError(Refusal.ARGUMENTS)
    return tuple(int(word) for word in words[1:])
