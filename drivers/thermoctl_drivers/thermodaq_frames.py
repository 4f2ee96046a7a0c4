"""The line protocol of the thermodaq board: bytes to values and back.

A request is ``>SS C arguments*CCCC`` and a line feed, a reply ``<SS C fields*CCCC`` and a line
feed: a sequence number of two hex digits, one letter, decimal fields, and a CRC-16 (polynomial
0x1021, start 0xFFFF) over what lies between the first character and the star. The grammar, with
every reply byte by byte, is in docs/drivers/thermodaq.md.
"""

from __future__ import annotations

import binascii
import re
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Final

PRODUCT: Final = "thermodaq"
PROTOCOL: Final = 1
FULL_POWER: Final = 10_000
COUNTS_PER_CONVERSION: Final = 1024
LINE_MAX: Final = 80
SHORTEST_REPLY: Final = len(b"<00 E 1*0000\n")
UNKNOWN_SENDER: Final = "--"
"""Sequence number of a refusal when the board could not read the one it was sent."""

_BODY = re.compile(rb"([0-9A-F]{2}|--) ([A-Z])((?: [0-9A-Za-z.]+)*)")
_TAIL_LENGTH = len(b"*0000\n")


class FrameError(ValueError):
    """A line that is none of the board's."""


class Flag(IntFlag):
    """State of the board in a reply."""

    RESET = 0x01
    UNCONFIGURED = 0x02
    CUT = 0x04
    SYNCHRONOUS = 0x08
    HEATING = 0x10


class Cut(IntEnum):
    """Why the output is off although nobody commanded it."""

    NONE = 0
    DEAD_MAN = 1
    RESET = 2
    CONFIGURED = 3


class Refusal(IntEnum):
    """Why the board did not obey."""

    TOO_LONG = 1
    MALFORMED = 2
    CHECKSUM = 3
    COMMAND = 4
    ARGUMENTS = 5
    RANGE = 6
    UNCONFIGURED = 7
    HEATING = 8


@dataclass(frozen=True, slots=True)
class Reply:
    """One valid line of the board; `sequence` is None when it could not read ours."""

    sequence: int | None
    letter: str
    fields: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Hello:
    """Reply to ``H``: who is there, and why it last started (MCUSR of the chip)."""

    product: str
    protocol: int
    version: str
    unit: int
    reset_cause: int
    flags: Flag


@dataclass(frozen=True, slots=True)
class Reading:
    """Reply to ``R``: the last burst and the state of the output.

    Parameters
    ----------
    total : int
        Sum of `count` conversions of 10 bits.
    count : int
        Conversions in the burst; 0 before the first one is complete.
    sequence : int
        Counts bursts, modulo 65536.
    age_ms : int
        Time since the middle of the burst, when the board made the reply.
    power : int
        Power in force, in 1/10000.
    """

    total: int
    count: int
    sequence: int
    age_ms: int
    power: int
    cut: int
    flags: Flag


@dataclass(frozen=True, slots=True)
class Written:
    """Reply to ``W``: the power that was taken, in 1/10000, and for how long."""

    power: int
    valid_ms: int
    flags: Flag


def checksum(body: bytes) -> int:
    """Return the CRC-16 of `body`, also known as CCITT-FALSE or IBM-3740."""
    return binascii.crc_hqx(body, 0xFFFF)


def frame(start: bytes, body: bytes) -> bytes:
    """Return a whole line: `start`, `body`, the checksum and a line feed."""
    return start + body + b"*%04X\n" % checksum(body)


def request(sequence: int, letter: str, *arguments: int) -> bytes:
    """Return the line that asks for `letter` with `arguments`, each in 0..65535."""
    words = [f"{sequence & 0xFF:02X}", letter, *(str(argument) for argument in arguments)]
    return frame(b">", " ".join(words).encode("ascii"))


def body_of(line: bytes, start: bytes) -> bytes:
    """Return what a whole line carries; raise `FrameError` when its frame is damaged."""
    text = line.rstrip(b"\r\n")
    if not text.startswith(start) or len(text) < 6 or text[-5:-4] != b"*":
        raise FrameError(f"expected a line {start.decode()}...*CCCC, got {line!r}")
    body, given = text[1:-5], text[-4:]
    if given != b"%04X" % checksum(body):
        raise FrameError(f"expected checksum {checksum(body):04X}, got {line!r}")
    return body


def decode(line: bytes) -> Reply:
    """Return the reply in `line`; raise `FrameError` if there is none."""
    body = body_of(line, b"<")
    parts = _BODY.fullmatch(body)
    if parts is None:
        raise FrameError(f"expected a sequence number and a letter, got {line!r}")
    sequence, letter, fields = (part.decode("ascii") for part in parts.groups())
    number = None if sequence == UNKNOWN_SENDER else int(sequence, 16)
    return Reply(number, letter, tuple(fields.split()))


def length_of(reply: Reply) -> int:
    """Return how many bytes the line of `reply` had."""
    return len(b"<00 H*0000\n") + sum(1 + len(field) for field in reply.fields)


def hello(reply: Reply) -> Hello:
    """Return the identity in `reply`; raise `FrameError` when it has another form."""
    try:
        product, protocol, version, unit, cause, flags = reply.fields
        return Hello(product, int(protocol), version, int(unit), int(cause), Flag(int(flags, 16)))
    except ValueError as error:
        raise FrameError(f"expected six fields of a hello, got {reply.fields!r}") from error


def reading(reply: Reply) -> Reading:
    """Return the sample in `reply`; raise `FrameError` when it has another form."""
    try:
        *numbers, flags = reply.fields
        total, count, sequence, age_ms, power, cut = (int(number) for number in numbers)
        state = Flag(int(flags, 16))
    except ValueError as error:
        raise FrameError(f"expected seven fields of a reading, got {reply.fields!r}") from error
    if total >= COUNTS_PER_CONVERSION * max(count, 1):
        raise FrameError(f"expected a sum below {COUNTS_PER_CONVERSION} * {count}, got {total}")
    return Reading(total, count, sequence, age_ms, power, cut, state)


def written(reply: Reply) -> Written:
    """Return what was taken; raise `FrameError` when `reply` has another form."""
    try:
        power, valid_ms, flags = reply.fields
        return Written(int(power), int(valid_ms), Flag(int(flags, 16)))
    except ValueError as error:
        raise FrameError(f"expected three fields of a write, got {reply.fields!r}") from error


def refusal(reply: Reply) -> str:
    """Return the reason in a refusal as words: ``6 range``."""
    try:
        reason = Refusal(int(reply.fields[0]))
    except (ValueError, IndexError):
        return " ".join(reply.fields) or "without a reason"
    return f"{reason.value} {reason.name.lower().replace('_', ' ')}"


class Assembler:
    """Cuts a byte stream into lines, in bounded memory whatever comes."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def clear(self) -> None:
        """Forget a half line."""
        self._pending.clear()

    def feed(self, received: bytes) -> list[bytes]:
        """Return the lines that `received` completes; keep at most one started line."""
        self._pending += received
        *lines, rest = self._pending.split(b"\n")
        self._pending = bytearray(rest[-LINE_MAX:])
        return [bytes(line[-LINE_MAX:]) + b"\n" for line in lines]

    @property
    def half(self) -> bytes:
        """The line that has begun and not ended."""
        return bytes(self._pending)

    @property
    def missing(self) -> int:
        """Bytes that must still come before a reply can be complete, at least 1.

        Asking a port for exactly these never waits longer than the reply takes.
        """
        start = self._pending.rfind(b"<")
        if start < 0:
            return SHORTEST_REPLY
        length = len(self._pending) - start
        star = self._pending.find(b"*", start)
        if star >= 0:
            return max(star + _TAIL_LENGTH - len(self._pending), 1)
        return max(SHORTEST_REPLY - length, _TAIL_LENGTH)
