"""The units that keys wear, and what a key in another unit was meant to be."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final

from thermoctl.quantities import ZERO_CELSIUS_K, is_finite_number

_UNITS: Final = {
    "k_per_s": "K/s",
    "per_s": "1/s",
    "per_k": "1/K",
    "kelvin_per_v": "K/V",
    "c": "°C",
    "k": "K",
    "s": "s",
    "w": "W",
    "v": "V",
    "mv": "mV",
    "l": "l",
    "kg": "kg",
    "hz": "Hz",
    "ohm": "Ω",
    "bits": "bit",
    "baud": "bit/s",
}
_OTHER: Final[dict[str, tuple[str, Callable[[float], float]]]] = {
    "f": ("c", lambda f: (f - 32.0) / 1.8),
    "k": ("c", lambda k: k - ZERO_CELSIUS_K),
    "degc": ("c", lambda c: c),
    "ms": ("s", lambda ms: ms / 1e3),
    "min": ("s", lambda minutes: minutes * 60.0),
    "h": ("s", lambda hours: hours * 3600.0),
    "kw": ("w", lambda kw: kw * 1e3),
    "mv": ("v", lambda mv: mv / 1e3),
    "v": ("mv", lambda v: v * 1e3),
    "ml": ("l", lambda ml: ml / 1e3),
    "kohm": ("ohm", lambda kohm: kohm * 1e3),
    "khz": ("hz", lambda khz: khz * 1e3),
}


def celsius(value: float, unit: str) -> float:
    """Return a temperature in degC that was written in `unit`.

    Parameters
    ----------
    value : float
        The number that was written.
    unit : str
        C, F or K in letters of any size, with ° or deg before it or without; "" is °C.

    Raises
    ------
    ValueError
        It is no unit of temperature.
    """
    worn = unit.strip().lower().removeprefix("deg").removeprefix("°")
    right, convert = ("c", _OTHER["degc"][1]) if worn in ("", "c") else _OTHER.get(worn, ("", None))
    if right != "c" or convert is None:
        raise ValueError(f"expected a unit of temperature, C, F or K, got {unit!r}")
    return convert(value)


def unit_of(key: str) -> str:
    """Return the unit that `key` wears, as ``°C`` for ``setpoint_c``, else ""."""
    parts = key.lower().split("_")
    for start in range(len(parts)):
        unit = _UNITS.get("_".join(parts[start:]))
        if unit is not None and (start > 0 or len(unit) > 2):
            return unit
    return ""


def other_unit(key: str, value: Any, known: Iterable[str]) -> str:
    """Return a hint when `key` is one of `known` in another unit, else "".

    The hint gives the value in the right unit, where it can be converted.
    """
    stem, _, worn = key.rpartition("_")
    meant = {each.rpartition("_")[2]: each for each in known if each.rpartition("_")[0] == stem}
    if not stem or not meant:
        return ""
    unit, convert = _OTHER.get(worn.lower(), ("", None))
    right = meant.get(unit) or next((each for each in meant.values() if unit_of(each)), None)
    if right is None:
        return ""
    hint = f"; the unit here is {unit_of(right)}: {right}"
    is_rate = stem.endswith("_per")  # its unit divides, and is left to the reader
    if unit in meant and convert is not None and not is_rate and is_finite_number(value):
        hint += f" = {convert(float(value)):.6g}"
    return hint
