"""Results on disk: a JSON line for each run, so that nothing is run twice.

A line is written in one piece when its run is over. What an interrupted write has left behind is
passed over, and the run done again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermoctl.errors import ThermoctlError


class StoreError(ThermoctlError):
    """Results cannot be read or kept; the message names the file and says why."""


@dataclass(frozen=True, slots=True)
class Result:
    """What came of one run, or the bounds of one.

    Parameters
    ----------
    key : str
        Says everything that the figures depend on; see `thermoctl.studies.compare.run`.
    controller, fleet, scenario : str
        Names.
    seed : int
        Which plant of the fleet.
    measures : mapping
        Figures by the keys of `thermoctl.studies.compare.score.MEASURES`; None: not in this run.
    failure : str or None
        Why the regulator gave up.
    """

    key: str
    controller: str
    fleet: str
    scenario: str
    seed: int
    measures: Mapping[str, float | None] = field(default_factory=dict)
    failure: str | None = None


class Store:
    """The results in one file: those that are there, and those that are added.

    Parameters
    ----------
    path : Path
        The file; made, with its folder, when the first result comes.

    Raises
    ------
    StoreError
        The file is there and cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.passed_over = 0
        self._results: dict[str, Result] = {}
        for line in _lines(path):
            result = _result(line)
            if result is None:
                self.passed_over += 1
            else:
                self._results[result.key] = result
        self._whole = path.is_file() and not _ends_torn(path)

    def __contains__(self, key: str) -> bool:
        return key in self._results

    def __getitem__(self, key: str) -> Result:
        return self._results[key]

    def __len__(self) -> int:
        return len(self._results)

    def add(self, result: Result) -> None:
        """Keep `result`, at once.

        Raises
        ------
        StoreError
            The file cannot be written.
        """
        fields = {name: getattr(result, name) for name in Result.__slots__}
        line = json.dumps(fields, allow_nan=False, ensure_ascii=False)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line + "\n" if self._whole or not file.tell() else f"\n{line}\n")
        except OSError as error:
            raise StoreError(f"{self.path}: expected a place for results: {error}") from error
        self._whole = True
        self._results[result.key] = result


def _lines(path: Path) -> list[str]:
    """Return the lines of `path`; none when it is not there."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StoreError(f"{path}: expected a file of results: {error.strerror}") from error


def _ends_torn(path: Path) -> bool:
    """Return whether the last line has no end, so that the next must not be joined to it."""
    content = path.read_bytes()
    return bool(content) and not content.endswith(b"\n")


def _result(line: str) -> Result | None:
    """Return the result in `line`; None when there is none."""
    try:
        fields = json.loads(line)
        result = Result(**fields)
    except (ValueError, TypeError):
        return None
    return result if _sound(result) else None


def _sound(result: Any) -> bool:
    """Return whether every field of a result that was read is what it should be."""
    words = (result.key, result.controller, result.fleet, result.scenario)
    if not all(isinstance(word, str) for word in words) or not isinstance(result.seed, int):
        return False
    measures = result.measures
    return isinstance(measures, dict) and all(
        value is None or (isinstance(value, int | float) and math.isfinite(value))
        for value in measures.values()
    )
