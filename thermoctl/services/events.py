"""Every event and alarm code there is, with the level of its line in the journal.

The names are API. What each one means stands in ``docs/events.md``, and a test holds the two and
the source together.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

PRIORITIES: Final[Mapping[str, int]] = MappingProxyType(
    {"critical": 2, "error": 3, "warning": 4, "info": 6}
)
"""Levels and their syslog priorities."""

_BY_LEVEL: Final = {
    "critical": (
        "trip.over_temperature",
        "trip.under_temperature",
        "latch.unreadable",
        "loop.failed",
    ),
    "error": (
        "board.failed",
        "board.fault",
        "board.lost",
        "board.wrong",
        "config.refused",
        "controller.failed",
        "cycle.failed",
        "feed.failed",
        "estimator.failed",
        "heater.no_response",
        "heater.reversed",
        "heater.stuck_on",
        "output.nan",
        "output.readback",
        "output.refused",
        "sensor.open",
        "sensor.short",
        "sensor.stuck",
        "socket.failed",
    ),
    "warning": (
        "balance.failed",
        "board.retry",
        "board.silent",
        "clock.stepped",
        "config.coarse",
        "config.narrow",
        "config.unstated",
        "controller.gain_doubtful",
        "controller.refused",
        "controller.tuning_failed",
        "cycle.late",
        "cycle.missed",
        "estimator.rejected",
        "estimator.reset",
        "heater.questioned",
        "history.drops",
        "history.failed",
        "history.set_aside",
        "insight.failed",
        "journal.drops",
        "latch.kept",
        "latch.unsaved",
        "model.ignored",
        "orders.failed",
        "plant.drift",
        "plant.driven",
        "sensor.disagree",
        "sensor.first_lost",
        "sensor.missing",
        "sensor.second_lost",
        "sensor.spike",
        "sensor.stale",
        "setpoint.unreachable",
        "shadow.failed",
        "socket.unavailable",
        "state.ignored",
    ),
    "info": (
        "alarm.acknowledged",
        "board.opened",
        "config.loaded",
        "controller.changed",
        "controller.detuned",
        "controller.resumed",
        "controller.tuned",
        "controller.tuning",
        "heater.answered",
        "history.recovered",
        "latch.saved",
        "load.changed",
        "loop.not_resumed",
        "loop.started",
        "loop.stopped",
        "mode.changed",
        "model.dropped",
        "model.recalled",
        "model.trusted",
        "orders.changed",
        "output.changed",
        "output.in_order",
        "plant.changed",
        "request.refused",
        "setpoint.changed",
        "setpoint.resumed",
        "shadow.changed",
        "sim.disturbed",
        "socket.opened",
        "state.changed",
    ),
}

EVENTS: Final[Mapping[str, str]] = MappingProxyType(
    {name: level for level, names in _BY_LEVEL.items() for name in names}
)
"""Level of every event by its name."""

REASONS: Final = frozenset(
    {
        "heater.check",
        "latch.cleared",
        "limit.changeover",
        "limit.high",
        "limit.low",
        "limit.rate",
        "master.off",
        "sensor.good",
    }
)
"""Dotted names that only occur as the reason of a power or of a change of state."""

RESERVED: Final = frozenset({"estimator.rejected", "sensor.stale"})
"""Events that nothing reports at present; an old sample counts as a missing one."""


def level_of(name: str) -> str:
    """Return the level of the event `name`; an unknown one is a warning."""
    return EVENTS.get(name, "warning")
