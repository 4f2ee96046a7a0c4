"""What ``thermoctl tune`` leaves behind: the run, and a report of what it taught."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.results import say
from thermoctl.app.tuning.suggestion import in_force, suggested, suggestion_text
from thermoctl.app.tuning.trial import NAMES, Ending, Outcome
from thermoctl.errors import Unavailable
from thermoctl.studies.excitation import Excitation
from thermoctl.studies.record import Record
from thermoctl.studies.tuning import Tuning
from thermoctl.studies.tuning_figure import draw_tuning
from thermoctl.studies.tuning_limits import Proposal, proposed
from thermoctl.studies.tuning_words import limit_lines, limits_json, tuning_json, tuning_lines
from thermoctl.studies.words import duration

RUN: Final = "run.csv"
TEXT: Final = "report.txt"
JSON: Final = "report.json"
FIGURE: Final = "report.png"

_NOTHING: Final[dict[str, Any]] = {"orders": [], "chosen": None, "model": None, "plant": None}


@dataclass(frozen=True, eq=False)
class Report:
    """A run and what it taught.

    Parameters
    ----------
    loop : str
        Name of the loop.
    table : LoopTable
        The loop as it is configured.
    simulated : bool
        Whether it ran on a simulated tank.
    excitation : Excitation
        The test signal.
    outcome : Outcome
        How the run ended.
    record : Record or None
        The samples; None where there are none to speak of.
    tuning : Tuning or None
        What they taught.
    why_nothing : str
        Why they taught nothing; else empty.
    dead_man_s : float or None
        Dead-man time of the loop's board, where it has one.
    """

    loop: str
    table: LoopTable
    simulated: bool
    excitation: Excitation
    outcome: Outcome
    record: Record | None
    tuning: Tuning | None
    why_nothing: str = ""
    dead_man_s: float | None = None

    @property
    def suggestion(self) -> dict[str, Any] | None:
        """Keys of a better model table, where they are known."""
        return None if self.tuning is None else suggested(self.table, self.tuning)

    @cached_property
    def limits(self) -> tuple[Proposal, ...]:
        """Limits that suit the plant; none where it was not heard."""
        if self.tuning is None:
            return ()
        return proposed(self.tuning, in_force(self.table, self.dead_man_s))

    def as_json(self, folder: Path) -> dict[str, Any]:
        """Return the report as one object; None for what is not known."""
        outcome, keys = self.outcome, self.suggestion
        found = _NOTHING | {"undecided": self.why_nothing}
        if self.tuning is not None:
            found = tuning_json(self.tuning)
        hottest_c = outcome.hottest_c
        return {
            "loop": self.loop,
            "simulated": self.simulated,
            "ending": outcome.ending.value,
            "why": outcome.why,
            "off_confirmed": outcome.off_confirmed,
            "hottest_c": hottest_c if math.isfinite(hottest_c) else None,
            "reached": outcome.reached,
            "signal": dataclasses.asdict(self.excitation),
            "samples": 0 if self.record is None else len(self.record.t_s),
            **found,
            "limits": limits_json(self.limits),
            "suggestion": keys,
            "suggestion_toml": self._toml(),
            "folder": str(folder),
        }

    def lines(self) -> list[str]:
        """Return the report as lines for people."""
        plan, outcome = self.excitation, self.outcome
        where = "simulated tank" if self.simulated else "own board"
        lines = [
            f"Loop     {self.loop} on its {where}: {100 * plan.low:g} and {100 * plan.high:g} %"
            f" power, {plan.bottom_c:g} to {plan.top_c:g} °C, {duration(plan.duration_s)}",
            f"Ended    {_ending_words(outcome)}",
        ]
        if not outcome.reached:
            lines.append(
                f"Band     not reached: {plan.middle_c:g} °C, where the test signal begins, needs a"
                " longer --duration, or a set point nearer to where the loop is"
            )
        elif self._stayed_above():
            lines.append(
                f"Band     not reached: no reading fell to {plan.top_c:g} °C, and a heater cannot"
                " lead there; choose a set point above where the loop rests"
            )
        if self.tuning is None:
            return [*lines, f"Nothing was learnt: {self.why_nothing}"]
        lines += tuning_lines(self.tuning)
        lines += limit_lines(self.limits)
        toml = self._toml()
        if toml is not None:
            lines += ["", "Suggested for the configuration:", "", *toml.splitlines()]
        return lines

    def _stayed_above(self) -> bool:
        """Return whether it was warmer than the band all the while, so that nothing was given."""
        return self.record is not None and bool(self.record.y.min() > self.excitation.top_c)

    def _toml(self) -> str | None:
        keys = self.suggestion
        if keys is None or self.tuning is None:
            return None
        return suggestion_text(self.loop, self.table, keys, self.tuning, self.limits)

    def write(self, folder: Path) -> list[Path]:
        """Write text, JSON, run and figure; return what was written."""
        (folder / TEXT).write_text("\n".join(self.lines()) + "\n", encoding="utf-8")
        content = json.dumps(self.as_json(folder), allow_nan=False, ensure_ascii=False, indent=1)
        (folder / JSON).write_text(content + "\n", encoding="utf-8")
        written = [folder / TEXT, folder / JSON]
        if self.record is not None:
            _write_run(folder / RUN, self.record)
            written.append(folder / RUN)
        if self.tuning is not None:
            try:
                page = [folder / FIGURE]
                written += draw_tuning(self.tuning, self.excitation, page, self.limits)
            except Unavailable as missing:
                say([str(missing)])
        return written


def _ending_words(outcome: Outcome) -> str:
    """Return how the run ended, and whether the heater is off."""
    words = {
        Ending.FINISHED: "as planned",
        Ending.INTERRUPTED: "interrupted; the samples so far are used",
        Ending.FAULT: f"by a fault, {outcome.why}; the samples so far are used",
    }[outcome.ending]
    off = "power 0 confirmed" if outcome.off_confirmed else "POWER 0 NOT CONFIRMED, look at it"
    hottest = f", hottest {outcome.hottest_c:.2f} °C" if math.isfinite(outcome.hottest_c) else ""
    return f"{words}; {off}{hottest}"


def _write_run(path: Path, record: Record) -> None:
    """Write the samples as ``replay`` reads them."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow((NAMES.time, NAMES.input, NAMES.output))
        for t_s, u, y in zip(record.t_s, record.u, record.y, strict=True):
            writer.writerow((f"{t_s:.6g}", f"{u:.6g}", f"{y:.6f}"))
