"""Roles and their looks: one hue, one meaning, said by shape and word too."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from functools import cache

from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from thermoctl.studies.words import ascii_only, is_utf8


class Role(Enum):
    """What a piece of the picture means; the look decides how that appears."""

    PAGE = auto()
    INK = auto()
    """Measured: the value now."""
    STRONG = auto()
    TEXT = auto()
    MUTE = auto()
    """Labels, axes, units."""
    SLATE = auto()
    """Power."""
    RULE = auto()
    BLUE = auto()
    """Belief: estimates, ±2σ, change points."""
    AMBER = auto()
    RED = auto()
    CHIP = auto()
    STALE_BAR = auto()
    """Absence of knowledge: inverted, without a hue."""
    RED_BAR = auto()
    """LATCHED or SAFE."""


class Colour(Enum):
    """What the terminal can show."""

    TRUE = "truecolor"
    ANSI = "standard"
    NONE = "none"


_PAGE = "#121517"

_STYLES: Mapping[Colour, Mapping[Role, str]] = {
    Colour.TRUE: {
        Role.PAGE: f"#D5DBE0 on {_PAGE}",
        Role.INK: f"#F1F4F6 on {_PAGE}",
        Role.STRONG: f"bold #F1F4F6 on {_PAGE}",
        Role.TEXT: f"#D5DBE0 on {_PAGE}",
        Role.MUTE: f"#98A3AB on {_PAGE}",
        Role.SLATE: f"#8996A0 on {_PAGE}",
        Role.RULE: f"#4A545B on {_PAGE}",
        Role.BLUE: f"#6DB5F2 on {_PAGE}",
        Role.AMBER: f"#EDB440 on {_PAGE}",
        Role.RED: f"bold #FF6A5A on {_PAGE}",
        Role.CHIP: "bold #F1F4F6 on #353E45",
        Role.STALE_BAR: f"bold {_PAGE} on #F1F4F6",
        Role.RED_BAR: "bold #FFFFFF on #C4392B",
    },
    Colour.ANSI: {
        Role.PAGE: "default",
        Role.INK: "default",
        Role.STRONG: "bold",
        Role.TEXT: "default",
        Role.MUTE: "bright_black",
        Role.SLATE: "bright_black",
        Role.RULE: "bright_black",
        Role.BLUE: "blue",
        Role.AMBER: "yellow",
        Role.RED: "bold red",
        Role.CHIP: "bold reverse",
        Role.STALE_BAR: "bold reverse",
        Role.RED_BAR: "bold white on red",
    },
    Colour.NONE: {
        **dict.fromkeys(Role, ""),
        Role.STRONG: "bold",
        Role.RED: "bold",
        Role.CHIP: "reverse",
        Role.STALE_BAR: "reverse",
        Role.RED_BAR: "bold reverse",
    },
}


_STYLE_BOOK = Console(quiet=True)  # only asked what a style means; it never prints


@cache
def _style(colour: Colour, role: Role) -> Style:
    return Style.parse(_STYLES[colour][role])


def printable(string: str, *, utf8: bool) -> str:
    """Return `string` on one line without control characters, ASCII if need be."""
    if not utf8:
        string = ascii_only(string)
    if string.isprintable():
        return string
    return "".join(c if c.isprintable() or c == "\N{NO-BREAK SPACE}" else " " for c in string)


@dataclass(frozen=True, slots=True)
class Look:
    """What the terminal can show, and the pieces of text that follow from it.

    Parameters
    ----------
    colour : Colour
        Truecolor, the terminal's own eight hues, or none at all.
    utf8 : bool
        Whether braille and symbols may be used; `*`, `#` and words otherwise.
    """

    colour: Colour = Colour.TRUE
    utf8: bool = True

    def style(self, role: Role) -> Style:
        """Return the rich style of `role`."""
        return _style(self.colour, role)

    def text(self, *parts: tuple[str, Role], ground: Role = Role.PAGE) -> Text:
        """Return one line made of (string, role) parts; `ground` is what is around them."""
        line = Text(style=self.style(ground), end="", no_wrap=True)
        for string, role in parts:
            line.append(printable(string, utf8=self.utf8), self.style(role))
        return line


def segments(line: Text) -> Iterable[Segment]:
    """Return the pieces of `line` that have one style, from left to right."""
    return line.render(_STYLE_BOOK)


def look_for(encoding: str | None, environ: Mapping[str, str] | None = None) -> Look:
    """Return the look for a terminal of `encoding`, as `environ` describes it.

    Parameters
    ----------
    encoding : str or None
        Encoding of the output stream; anything but UTF-8 gets ASCII.
    environ : mapping, optional
        ``NO_COLOR``, ``COLORTERM`` and ``TERM`` are read; the process environment by default.
    """
    environ = os.environ if environ is None else environ
    utf8 = is_utf8(encoding)
    if environ.get("NO_COLOR") or environ.get("TERM") == "dumb":
        return Look(Colour.NONE, utf8)
    rich_in_hues = environ.get("COLORTERM", "").lower() in {"truecolor", "24bit"}
    return Look(Colour.TRUE if rich_in_hues else Colour.ANSI, utf8)
