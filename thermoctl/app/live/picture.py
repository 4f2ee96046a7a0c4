"""The view as an SVG for pages on paper and on the net.

Dots are drawn as dots, and each word is set where its cell is, so that the picture is the same
whichever fonts the reader has.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import escape

from rich.cells import cell_len
from rich.color import Color
from rich.style import Style
from rich.text import Text

from thermoctl.app.live.look import Look, Role, segments

_CELL_WIDE, _CELL_HIGH = 8.4, 17.0
_SIZE, _BASELINE = 14.0, 12.6
_MARGIN = 12.0
_DOT = 2.2
_FONTS = "ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace"
_DOT_PLACES = ((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3))
"""Column and row of each braille dot, in the order of its bit."""


def _hex(colour: Color | None, default: str) -> str:
    return default if colour is None else colour.get_truecolor().hex


def _words(string: str) -> Iterator[tuple[int, str]]:
    """Yield each word of `string` with the cell it begins at; braille is no word."""
    begin = None
    for at, character in enumerate(string + " "):
        is_word = not character.isspace() and not _is_dots(character)
        if is_word and begin is None:
            begin = at
        elif not is_word and begin is not None:
            yield begin, string[begin:at]
            begin = None


def _is_dots(character: str) -> bool:
    return 0x2800 <= ord(character) <= 0x28FF


def _dots(string: str, left: float, top: float) -> str:
    """Return a path with a round point for each braille dot in `string`."""
    points = []
    for at, character in enumerate(string):
        if not _is_dots(character):
            continue
        for bit, (column, row) in enumerate(_DOT_PLACES):
            if (ord(character) - 0x2800) >> bit & 1:
                x = left + (at + 0.25 + 0.5 * column) * _CELL_WIDE
                y = top + (row + 0.5) * _CELL_HIGH / 4.0
                points.append(f"M{x:.1f} {y:.1f}h0")
    return "".join(points)


def _line(line: Text, top: float, page: str) -> Iterator[str]:
    """Yield the elements of one row."""
    at = 0
    for string, style, _ in segments(line):
        left = _MARGIN + at * _CELL_WIDE
        at += cell_len(string)
        style = style or Style()
        ink, ground = _hex(style.color, "#D5DBE0"), _hex(style.bgcolor, page)
        if ground != page:
            yield (
                f'<rect x="{left:.1f}" y="{top:.1f}" width="{len(string) * _CELL_WIDE:.1f}" '
                f'height="{_CELL_HIGH:.1f}" fill="{ground}" shape-rendering="crispEdges"/>'
            )
        points = _dots(string, left, top)
        if points:
            yield f'<path d="{points}" stroke="{ink}"/>'
        weight = ' font-weight="bold"' if style.bold else ""
        for begin, word in _words(string):
            yield (
                f'<text x="{left + begin * _CELL_WIDE:.1f}" y="{top + _BASELINE:.1f}" '
                f'textLength="{len(word) * _CELL_WIDE:.1f}" lengthAdjust="spacingAndGlyphs" '
                f'fill="{ink}"{weight}>{escape(word)}</text>'
            )


def svg(rows: Sequence[Text], look: Look, title: str) -> str:
    """Return rendered `rows` as an SVG document.

    Parameters
    ----------
    rows : sequence of Text
        Rows of equal width, in truecolor.
    look : Look
        The look they were rendered with; its page is the ground.
    title : str
        What the picture shows, for those who cannot see it.
    """
    page = _hex(look.style(Role.PAGE).bgcolor, "#121517")
    width = 2 * _MARGIN + _CELL_WIDE * max((row.cell_len for row in rows), default=0)
    height = 2 * _MARGIN + _CELL_HIGH * len(rows)
    elements = [
        element
        for number, row in enumerate(rows)
        for element in _line(row, _MARGIN + number * _CELL_HIGH, page)
    ]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            f'role="img" font-family="{_FONTS}" font-size="{_SIZE:g}">',
            f"<title>{escape(title)}</title>",
            f'<rect width="100%" height="100%" rx="8" fill="{page}"/>',
            f'<g fill="none" stroke-width="{_DOT}" stroke-linecap="round">',
            *(element for element in elements if element.startswith("<path")),
            "</g>",
            *(element for element in elements if not element.startswith("<path")),
            "</svg>\n",
        ]
    )
