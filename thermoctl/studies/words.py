"""Probabilities, counts and lengths of time in words; any text in ASCII."""

from __future__ import annotations

import math

_ASCII = str.maketrans(
    {
        "\N{NO-BREAK SPACE}": " ",
        "\N{MINUS SIGN}": "-",
        "–": "-",
        "×": "x",
        "±": "+-",
        "σ": "s",
        "λ": "lambda",
        "µ": "u",
        "°": "deg",
        "·": ".",
        "─": "-",
        "┊": ":",
        "╱": "/",
        "△": "!",
        "▲": "!",
        "■": "#",
        "◆": "*",
        "▴": "^",
        "▾": "v",
        "↑": "up/",
        "↓": "dn",
        "…": "~",
        "→": "->",
        "√": "sqrt",
        "²": "2",
    }
)


def probability(p: float) -> str:
    """Return a probability in two digits, nothing below a thousandth."""
    if math.isnan(p):
        return "–"
    return "< 0.001" if p < 0.001 else f"{p:.2g}" if p < 0.1 else f"{p:.2f}"


def counted(count: int, what: str) -> str:
    """Return how many there are of `what`, which takes an s when they are not one."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def duration(seconds: float) -> str:
    """Return a length of time in its two largest units."""
    if seconds < 60.0:
        return f"{seconds:.3g} s"
    minutes, s = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    parts = [(days, "d"), (hours, "h"), (minutes, "min"), (s, "s")]
    first = next(place for place, (count, _) in enumerate(parts) if count)
    return " ".join(f"{count} {unit}" for count, unit in parts[first : first + 2] if count)


def is_utf8(encoding: str | None) -> bool:
    """Return whether a stream of this `encoding` can show every sign."""
    return (encoding or "").lower().replace("-", "") == "utf8"


def ascii_only(text: str) -> str:
    """Return `text` in ASCII: signs as words or look-alikes, else a question mark."""
    return text.translate(_ASCII).encode("ascii", "replace").decode("ascii")
