"""Framing of the thermodaq line: laws over arbitrary bytes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.thermodaq_frames import Assembler, FrameError, Reply

FIELDS = st.lists(st.from_regex(r"[0-9A-Za-z.]{1,8}", fullmatch=True), min_size=1, max_size=7)
REPLIES = st.builds(
    Reply, st.integers(0, 255) | st.none(), st.sampled_from("HCRWUE"), FIELDS.map(tuple)
)


def line_of(reply: Reply) -> bytes:
    sequence = "--" if reply.sequence is None else f"{reply.sequence:02X}"
    return frames.frame(b"<", " ".join([sequence, reply.letter, *reply.fields]).encode())


@given(REPLIES)
def test_a_reply_survives_the_round_trip(reply: Reply) -> None:
    assert frames.decode(line_of(reply)) == reply


@given(REPLIES, st.data())
def test_a_single_damaged_bit_never_passes(reply: Reply, data: st.DataObject) -> None:
    line = bytearray(line_of(reply))
    place = data.draw(st.integers(0, len(line) - 2))
    line[place] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(FrameError):
        frames.decode(bytes(line))


@given(st.binary(max_size=100))
def test_arbitrary_bytes_are_a_frame_error_and_nothing_else(line: bytes) -> None:
    with pytest.raises(FrameError):
        frames.decode(line)


@given(REPLIES)
def test_a_valid_line_of_any_form_parses_or_is_a_frame_error(reply: Reply) -> None:
    for parse in (frames.hello, frames.reading, frames.written):
        try:
            parse(reply)
        except FrameError:
            continue
    assert frames.refusal(reply)


@given(st.lists(REPLIES, max_size=4), st.data())
def test_lines_are_found_however_the_stream_is_cut(
    replies: list[Reply], data: st.DataObject
) -> None:
    stream = b"".join(line_of(reply) for reply in replies)
    assembler, found = Assembler(), []
    while stream:
        size = data.draw(st.integers(1, 40))
        found += assembler.feed(stream[:size])
        stream = stream[size:]
    assert [frames.decode(line) for line in found] == replies


@given(REPLIES)
def test_asking_for_what_is_missing_never_waits_past_the_end_of_a_reply(reply: Reply) -> None:
    line, assembler = line_of(reply), Assembler()
    taken = 0
    while taken < len(line):
        size = assembler.missing
        assert 1 <= size <= len(line) - taken
        assembler.feed(line[taken : taken + size])
        taken += size


def test_memory_is_bounded_whatever_comes() -> None:
    assembler = Assembler()
    for _ in range(1000):
        assert assembler.feed(b"x" * 1000) == []
        assert len(assembler.half) <= frames.LINE_MAX
    assert 1 <= assembler.missing <= frames.SHORTEST_REPLY
