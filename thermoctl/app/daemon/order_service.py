"""Watches of orders in a thread, and what they find as keys and events.

What weighs (`thermoctl.app.daemon.order_watch`) is loaded only where a loop asks for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.daemon.beside import Beside, Report
from thermoctl.signals import Cycle

if TYPE_CHECKING:
    from thermoctl.app.daemon.order_watch import Finding, OrderWatch
    from thermoctl.estimation import Order


class OrderService(Beside["OrderWatch"]):
    """Runs watches in a thread; one that fails is dropped and told of.

    Parameters
    ----------
    watches : mapping
        A watch by the name of its loop.
    report : callable
        Called as ``report(name, loop, **fields)`` in the thread.
    """

    def __init__(self, watches: Mapping[str, OrderWatch], report: Report) -> None:
        super().__init__("orders", "orders.failed", watches, report)
        self._named: dict[str, Order] = {}

    def keys(self, loop: str) -> dict[str, Any]:
        """Return the keys a line of JSON on `loop` gets, none while nothing is known."""
        watch = self._watches.get(loop)
        return {} if watch is None or watch.finding is None else watch.finding.as_json()

    def look(self, watch: OrderWatch, cycle: Cycle) -> None:
        """Show `cycle` to its watch, and tell of an order that is newly found."""
        found = watch.take(cycle)
        if found is not None:
            self._tell(cycle.loop, found)

    def _tell(self, loop: str, found: Finding) -> None:
        before, self._named[loop] = self._named.get(loop), found.order
        order = found.order
        self._report(
            "orders.changed",
            loop,
            n=order.n,
            m=order.m,
            delay=order.delay,
            probability=round(found.probability, 4),
            before=None if before is None else [before.n, before.m, before.delay],
        )


def order_service(loops: Mapping[str, LoopTable], report: Report) -> OrderService | None:
    """Return what weighs orders beside `loops`; nothing is loaded where none asks."""
    if not any(table.weighs_orders for table in loops.values()):
        return None
    from thermoctl.app.daemon.order_watch import watches_for

    return OrderService(watches_for(loops), report)
