"""What is told of a plant, as lines of `thermoctl status`."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final

from thermoctl.insight.wording import UNKNOWN

CHANGES: Final = 3
"""So many changes are shown, the newest first; ``--json`` has all that are kept."""


def insight_lines(told: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Return name and value of each line; none where nothing is told.

    Parameters
    ----------
    told : mapping or None
        Key ``insight`` of a status record.
    """
    if told is None:
        return []
    lines = [("Learning", str(told["gate"])), *_quantities(told["rows"])]
    lines.append(("Performance", str(told["performance"]["verdict"])))
    lines += [("Drift", f"{_time(each['at'])} {each['text']}") for each in told["drifts"]]
    newest = told["changes"][:CHANGES]
    return lines + [("Changed", f"{_time(each['at'])} {each['text']}") for each in newest]


def _quantities(rows: list[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Return a line for each label; one quantity in several units is one line."""
    found: dict[str, list[str]] = {}
    why_not: dict[str, str] = {}
    for row in rows:
        label = str(row["label"]).capitalize()
        texts = found.setdefault(label, [])
        if row["value"] is None:
            why_not.setdefault(label, str(row["text"]))
        else:
            texts.append(str(row["text"]))
    return [(label, ", ".join(texts) or why_not[label]) for label, texts in found.items()]


def _time(iso: str | None) -> str:
    """Return a time of the day here, as people read it."""
    return UNKNOWN if iso is None else f"{datetime.fromisoformat(iso).astimezone():%H:%M}"
