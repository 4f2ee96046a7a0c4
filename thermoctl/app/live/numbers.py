"""How numbers are written: fixed decimals, true minus, dash for unknown.

Decimals depend on the quantity and never on the value, so that a column does not jump. A number
that is not finite is unknown; it becomes `UNKNOWN` here and so never reaches a screen.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from datetime import datetime, timedelta

UNKNOWN = "–"
NBSP = "\N{NO-BREAK SPACE}"
_MINUS = "\N{MINUS SIGN}"
_LIMIT = 1e7  # beyond it no quantity of a bath is believable, and no column wide enough


def number(value: float | None, decimals: int, *, signed: bool = False) -> str:
    """Return `value` with `decimals` digits after the point, or `UNKNOWN`."""
    if value is None or not math.isfinite(value) or abs(value) >= _LIMIT:
        return UNKNOWN
    digits = f"{abs(value):,.{decimals}f}"
    if not any(digit in digits for digit in "123456789"):
        return digits  # a rounded zero has no sign
    return (_MINUS if value < 0 else "+" if signed else "") + digits


def with_unit(digits: str, unit: str) -> str:
    """Return `digits` and `unit`, not to be parted; unknown takes no unit."""
    return digits if digits == UNKNOWN else f"{digits}{NBSP}{unit}"


def plus_minus(value: float, error: float, decimals: int) -> str:
    """Return `value` ± `error` with the same decimals; no ± where that is unknown."""
    digits, more = number(value, decimals), number(error, decimals)
    return digits if UNKNOWN in (digits, more) else f"{digits} ± {more}"


def temperature(value_c: float | None) -> str:
    """Return a temperature such as ``37.49 °C``."""
    return with_unit(number(value_c, 2), "°C")


def difference(value_k: float | None) -> str:
    """Return a signed difference: in mK within ±0.1 K, in K beyond.

    From 100 K on it has one decimal, and so fits eight cells up to 1000 K.
    """
    if value_k is not None and abs(value_k) <= 0.1:
        return with_unit(number(1e3 * value_k, 0, signed=True), "mK")
    decimals = 2 if value_k is None or abs(value_k) < 99.995 else 1
    return with_unit(number(value_k, decimals, signed=True), "K")


def millikelvin(value_k: float | None) -> str:
    """Return a difference without a sign, such as ``23 mK``."""
    return with_unit(number(None if value_k is None else 1e3 * abs(value_k), 0), "mK")


def power(fraction: float | None) -> str:
    """Return a power such as ``23.1 %``, from a fraction in [0, 1]."""
    return with_unit(number(None if fraction is None else 100.0 * fraction, 1), "%")


def seconds(value_s: float | None) -> str:
    """Return a duration such as ``73 s``."""
    return with_unit(number(value_s, 0), "s")


def age(value_s: float) -> str:
    """Return how old something is, in the unit that keeps it below a thousand."""
    if not value_s >= 1000.0:  # NaN too
        return with_unit(number(value_s, 1), "s")
    if value_s < 60_000.0:
        return with_unit(number(value_s / 60.0, 0), "min")
    return with_unit(number(value_s / 3600.0, 0), "h")


def span(value_s: float) -> str:
    """Return a length of time in its largest unit: ``60 min``, ``2 h``."""
    for unit, length_s in (("d", 86_400.0), ("h", 3600.0), ("min", 60.0)):
        if value_s > length_s:
            return with_unit(number(value_s / length_s, 0), unit)
    return seconds(value_s)


def wall_time(zero: datetime, t_s: float, pattern: str = "%H:%M:%S") -> str:
    """Return the wall time at loop time `t_s`; `zero` is that at 0."""
    try:
        return (zero + timedelta(seconds=t_s)).strftime(pattern)
    except (OverflowError, ValueError):  # NaN, or beyond the calendar
        return UNKNOWN


def plain(text: str) -> str:
    """Return `text` with the spaces that a search finds."""
    return text.replace(NBSP, " ")


def sentence(words: str) -> str:
    """Return `words` of a log, its degC and +- as the signs that the screen uses."""
    return re.sub(r"\s*\+-\s*", " ± ", re.sub(r"\s*\bdegC\b", f"{NBSP}°C", words))


_BY_SUFFIX: tuple[tuple[str, Callable[[float], str]], ...] = (
    ("power", power),
    ("_c", temperature),
    ("_k", difference),
    ("_us", lambda value: with_unit(number(value, 0), "µs")),
    ("_s", seconds),
    ("_w", lambda value: with_unit(number(value, 0), "W")),
    ("_kg", lambda value: with_unit(number(value, 1), "kg")),
)


def quantity(name: str, value: object) -> str:
    """Return `value` as its `name` asks: ``_c`` in °C, ``_s`` in s, ``power`` in %."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return sentence(str(value))
    for suffix, write in _BY_SUFFIX:
        if name.endswith(suffix):
            return write(float(value))
    return number(float(value), 0 if isinstance(value, int) else 2)
