"""How every figure looks: one style, one set of hues, SVG and PNG.

matplotlib is an extra (``thermoctl[plot]``) and is loaded only when something is drawn; no window
is opened and no global state of matplotlib is changed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from thermoctl.errors import Unavailable
from thermoctl.quantities import Array

INK, TEXT, MUTE, SLATE = "#161B1F", "#242B31", "#56616A", "#6C7882"
ALLOWED, BELIEF, OUTSIDE, FOURTH = "#C9D0D6", "#0B62A8", "#C25400", "#7F8A93"

WIDE_IN, NARROW_IN = 6.89, 3.35
"""Widths of two columns and of one, in inches."""

HUES = (BELIEF, INK, OUTSIDE, FOURTH)
"""The method under study, then the others."""

DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
"""One for each hue, so that a figure can be read in grey."""

TRUE_DASH = (0, (4, 2.5))
POINTS_PER_PANEL = 1_500
FORMATS = (".png", ".svg")

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 9.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "text.color": TEXT,
    "axes.labelcolor": TEXT,
    "axes.edgecolor": MUTE,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "axes.unicode_minus": True,
    "xtick.color": MUTE,
    "ytick.color": MUTE,
    "xtick.labelcolor": TEXT,
    "ytick.labelcolor": TEXT,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.1,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "savefig.dpi": 200.0,
    "svg.fonttype": "path",
    "svg.hashsalt": "thermoctl",
}


def require_matplotlib() -> None:
    """Raise `Unavailable`, saying what to install, where nothing can be drawn."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as missing:
        raise Unavailable(
            "figures need matplotlib, which is not installed: pip install thermoctl[plot]"
        ) from missing


@contextmanager
def styled(
    width_in: float, height_in: float, rows: int, columns: int, **grid: Any
) -> Iterator[tuple[Any, Any]]:
    """Give a figure and its axes, shape (rows, columns), in the house style.

    Parameters
    ----------
    width_in, height_in : float
        Size in inches; `WIDE_IN` and `NARROW_IN` are the usual widths.
    rows, columns : int
        Panels.
    **grid
        Passed on to ``Figure.subplots``.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    """
    require_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(width_in, height_in))
        yield figure, figure.subplots(rows, columns, squeeze=False, **grid)


def save(figure: Any, path: Path) -> Path:
    """Write `figure` to `path`; its suffix, .png or .svg, decides the format.

    The folder is made when it is not there. Call inside `styled`, whose style reaches the file too.

    Raises
    ------
    ValueError
        If the suffix is neither.
    OSError
        If it cannot be written; it names the file, and leaves no half of it.
    """
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise ValueError(f"expected a figure file ending in .png or .svg, got {path.name!r}")
    path.parent.mkdir(parents=True, exist_ok=True)
    # Without a date in it, the same run gives the same file.
    metadata = {"Date": None} if kind == ".svg" else {"Software": None}
    try:
        figure.savefig(path, format=kind[1:], metadata=metadata)
    except OSError as error:
        # A disk that is full is noticed while writing, when nobody remembers the name.
        if error.filename is None:
            error.filename = str(path)
        with suppress(OSError):
            if path.is_file():  # half a figure
                path.unlink()
        raise
    return path


def letter(axes: Any, text: str) -> None:
    """Write the bold panel letter above the left corner."""
    axes.set_title(text, loc="left", fontsize=8, fontweight="bold", color=INK, pad=5)


def score(axes: Any, text: str) -> None:
    """Write what a panel shows in numbers above its right corner."""
    axes.set_title(text, loc="right", fontsize=7.5, color=MUTE, pad=5)


def label(axes: Any, y: float, text: str, hue: str) -> None:
    """Write a line's name to the right of the panel, at `y` in the data."""
    axes.annotate(
        text,
        xy=(1.0, y),
        xycoords=axes.get_yaxis_transform(),
        xytext=(4, 0),
        textcoords="offset points",
        color=hue,
        fontsize=7.5,
        va="center",
        annotation_clip=False,
    )


def spread_out(places: Sequence[float], gap: float, low: float = -math.inf) -> list[float]:
    """Return `places` moved apart by `gap` or more, in their order, none below `low`."""
    order = np.argsort(places, kind="stable")
    apart = np.array(places, dtype=np.float64)[order]
    for index in range(1, len(apart)):
        apart[index] = max(apart[index], apart[index - 1] + gap)
    moved = np.empty_like(apart)
    if len(apart):
        apart -= 0.5 * (apart[-1] - max(places))
        apart += max(0.0, low - apart[0])
    moved[order] = apart
    return [float(place) for place in moved]


def broken(x: Array, y: Array, longest: float) -> tuple[Array, Array]:
    """Return the line with a hole wherever `x` steps further than `longest`."""
    holes = np.flatnonzero(np.diff(x) > longest) + 1
    return np.insert(x, holes, np.nan), np.insert(y, holes, np.nan)


def envelope(x: Array, y: Array, limit: int = POINTS_PER_PANEL) -> tuple[Array, Array]:
    """Return points that draw the same line as (`x`, `y`), about `limit` of them.

    Each stretch of a long record keeps its lowest and highest sample, in the order they came, so
    that no peak is lost as it would be in a mean; and one sample that is not known, where there is
    one, so that a hole stays a hole.

    Parameters
    ----------
    x, y : ndarray, shape (T,)
        What is to be drawn; `y` may hold NaN.
    limit : int
        Points, at least 3.
    """
    if len(y) <= limit:
        return x, y
    width = -(-3 * len(y) // limit)
    keep: list[int] = []
    for begin in range(0, len(y), width):
        piece = y[begin : begin + width]
        unknown = np.isnan(piece)
        chosen = {int(np.argmax(unknown))} if unknown.any() else set()
        if not unknown.all():
            chosen |= {int(np.nanargmin(piece)), int(np.nanargmax(piece))}
        keep.extend(begin + place for place in sorted(chosen))
    return x[keep], y[keep]


def time_unit(duration_s: float) -> tuple[float, str]:
    """Return the unit for a time axis of `duration_s` and its name."""
    for unit_s, name in ((1.0, "s"), (60.0, "min"), (3600.0, "h")):
        if duration_s <= 150.0 * unit_s:
            return unit_s, name
    return 86400.0, "d"
