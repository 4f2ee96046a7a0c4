"""What operators are told of their plants, reckoned beside the loops."""

from __future__ import annotations

from collections.abc import Mapping

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.daemon.beside import Beside, Report
from thermoctl.insight import Insight, Insights
from thermoctl.signals import Cycle


def insights_for(loops: Mapping[str, LoopTable]) -> dict[str, Insights]:
    """Return a watch for every loop."""
    return {name: _watch(table) for name, table in loops.items()}


def _watch(table: LoopTable) -> Insights:
    power_min = 0.0 if table.cooler is None else -table.cooler.power_max
    return Insights(table.period_s, table.heater_w, table.power_max, power_min)


class InsightService(Beside[Insights]):
    """Runs a watch for each loop in a thread; one that fails is dropped and told of.

    Parameters
    ----------
    watches : mapping
        A watch by the name of its loop.
    report : callable
        Called as ``report(name, loop, **fields)`` in the thread.
    """

    def __init__(self, watches: Mapping[str, Insights], report: Report) -> None:
        super().__init__("insight", "insight.failed", watches, report)
        self._told: dict[str, Insight] = {}

    def look(self, watch: Insights, cycle: Cycle) -> None:
        """Show `cycle` to its watch, and report what is news."""
        for event in watch.after(cycle.step, cycle.accepted_power):
            self._report(event.name, cycle.loop, **event.fields)
        self._told[cycle.loop] = watch.now

    def insight(self, loop: str) -> Insight | None:
        """Return what is told of `loop`; None before its first cycle was looked at."""
        return self._told.get(loop)
