"""Rows of a fixed width: fitted, ruled, and parted into left and right."""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text

from thermoctl.app.live.look import Look, Role

Part = tuple[str, Role]


def fitted(line: Text, width: int) -> Text:
    """Return `line` cut or padded to exactly `width` cells."""
    line.truncate(width, overflow="crop", pad=True)
    return line


def parted(
    look: Look,
    left: Sequence[Part],
    right: Sequence[Part],
    width: int,
    ground: Role = Role.PAGE,
) -> Text:
    """Return `left` and `right` at their edges; the right one goes first."""
    first, last = look.text(*left, ground=ground), look.text(*right)
    gap = width - first.cell_len - last.cell_len
    if gap < (1 if last.cell_len else 0):
        first.truncate(width, overflow="ellipsis" if look.utf8 else "crop")
        return fitted(first, width)
    first.append(" " * gap)
    first.append_text(last)
    return fitted(first, width)


def ruled(look: Look, title: str, note: str, width: int) -> Text:
    """Return a hairline with `title` and `note`; the note is cut first."""
    head = look.text(("── ", Role.RULE), (title, Role.STRONG), (" ", Role.PAGE))
    tail = look.text((f" {note} " if note else "", Role.MUTE))
    if head.cell_len + tail.cell_len + 2 > width:
        tail = look.text()
    length = max(0, width - head.cell_len - tail.cell_len)
    head.append_text(look.text(("─" * length, Role.RULE)))
    head.append_text(tail)
    return fitted(head, width)
