"""Orders weighed beside the loop by a consumer of cycles that never steers.

`thermoctl.app.daemon.order_service` shows the cycles to it. Why it lives here and not in the
regulator is the decision of ``docs/decisions/0014-orders-are-weighed-beside-the-loop.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.estimation import LainiotisBank, Order
from thermoctl.signals import Cycle, Mode, Quality
from thermoctl.studies.orders import EVIDENCE, SETTLED, USUAL
from thermoctl.studies.record import GAP, Columns, Record, RecordError
from thermoctl.studies.scaled import Scaling
from thermoctl.studies.wide import fit_wide

FIRST_LOOK: Final = 600
"""Samples after which the record is looked at for the first time, and then again and again."""

LONGEST_LOOK: Final = 3_600
"""Samples that are looked at at most: the newest ones."""

MOVED: Final = 0.05
"""The power moves when it is farther than this from its running mean."""

AT_BOUND: Final = 1e-3
"""A power no farther than this from its bound is at it."""

DRIFT: Final = 1e-9
"""Variance that scaled parameters gain per sample, so that years do not make them stiff."""

FLOORS: Final = 0.01
"""Probability of all candidates together that are as improbable as they may become."""

_MEAN_SHARE = 0.02
_NAMES = Columns("temperature_c", "accepted_power", "t_s")


@dataclass(frozen=True, slots=True)
class Finding:
    """The most probable order of a loop, and how probable it is."""

    order: Order
    probability: float

    def as_json(self) -> dict[str, Any]:
        """Return the keys this adds to a line of JSON."""
        order = self.order
        return {
            "order": [order.n, order.m, order.delay],
            "order_probability": round(self.probability, 4),
        }


class OrderWatch:
    """Weighs the orders of one loop, cycle by cycle.

    A power that a law computes from temperatures says nothing that they did not say. So samples
    count only where the power was an operator's or at one of its bounds; others are a gap. Until
    the input was heard, what counts is only kept. Then a bank takes all that is kept, and
    every such sample after it, but remembers it without judging while the power rests.

    Parameters
    ----------
    orders : sequence of Order
        The candidates.
    period_s : float
        Nominal time between two samples, in s.
    power_max : float
        Upper bound of the power.
    """

    def __init__(
        self, orders: Sequence[Order], period_s: float = 1.0, power_max: float = 1.0
    ) -> None:
        self._orders, self._period_s, self._power_max = tuple(orders), period_s, power_max
        structures = [order.structure() for order in self._orders]
        self._n = max(order.n for order in self._orders)
        self._inputs = max(each.u_memory for each in structures)
        self._reach = max(self._n, self._inputs)
        self._kept: list[tuple[float, float, float]] = []
        self._look_at = FIRST_LOOK
        self._scaling = Scaling()
        self._bank: LainiotisBank | None = None
        self._last_s, self._last_power = -math.inf, math.nan
        self._whole = 0
        self._mean, self._awake = math.nan, 0
        self.finding: Finding | None = None

    def take(self, cycle: Cycle) -> Finding | None:
        """Take a finished cycle; return what is newly found with 95 %, if anything."""
        step, power = cycle.step, cycle.accepted_power
        good = step.measurement.quality is Quality.GOOD and math.isfinite(
            step.measurement.temperature_c
        )
        if not (good and math.isfinite(power) and self._free(step.mode, power)):
            return None
        before = self.finding
        sample = (step.t_s, step.measurement.temperature_c, power)
        if self._bank is None:
            self._keep(sample)
        else:
            self._weigh(*sample)
        after = self.finding
        new = after is not None and (before is None or before.order != after.order)
        return after if new else None

    def _free(self, mode: Mode, power: float) -> bool:
        """Return whether `power` is not what a law made of the temperature."""
        bound = power <= AT_BOUND or power >= self._power_max - AT_BOUND
        return bound or mode in (Mode.MANUAL, Mode.OFF)

    def _keep(self, sample: tuple[float, float, float]) -> None:
        """Keep a sample, and see now and then whether the input was heard."""
        self._kept.append(sample)
        del self._kept[:-LONGEST_LOOK]
        self._look_at -= 1
        if self._look_at > 0:
            return
        self._look_at = FIRST_LOOK
        t_s, y, u = np.array(self._kept).T
        record = Record("loop", t_s - t_s[0], u, y, _NAMES)
        try:
            scaling = Scaling.of(record)
            wide = fit_wide(
                record, scaling.outputs(record), scaling.inputs(record), self._n, self._inputs
            )
        except RecordError:
            return  # still, or full of gaps: there will be other samples
        if self._inputs and wide.evidence < EVIDENCE:
            return
        self._scaling = Scaling(
            scaling.y_centre,
            scaling.y_scale,
            scaling.u_centre + wide.rest * scaling.u_scale,
            scaling.u_scale,
        )
        floor = FLOORS / len(self._orders)
        self._bank = LainiotisBank(self._orders, R=wide.R2, Q=DRIFT, floor=floor)
        for each in self._kept:
            self._weigh(*each)
        self._kept.clear()

    def _weigh(self, t_s: float, temperature_c: float, power: float) -> None:
        """Take a sample into the bank: judged, or only remembered."""
        bank, scaling = self._bank, self._scaling
        if bank is None:
            return
        gap = t_s - self._last_s > GAP * self._period_s
        self._whole = 0 if gap else self._whole + 1
        before = power if gap else self._last_power
        y = (temperature_c - scaling.y_centre) / scaling.y_scale
        u = (before - scaling.u_centre) / scaling.u_scale
        judged = self._whole >= self._reach and self._moving(before)
        self._bank = bank = bank.update(y, u) if judged else bank.remember(y, u)
        self._last_s, self._last_power = t_s, power
        best = int(np.argmax(bank.posterior))
        if bank.posterior[best] >= SETTLED:
            self.finding = Finding(self._orders[best], float(bank.posterior[best]))

    def _moving(self, power: float) -> bool:
        """Return whether the power has moved as lately as any candidate can feel."""
        if math.isnan(self._mean):
            self._mean = power
        self._awake = 2 * self._reach if abs(power - self._mean) > MOVED else self._awake - 1
        self._mean += _MEAN_SHARE * (power - self._mean)
        return self._awake > 0


def watches_for(loops: Mapping[str, LoopTable]) -> dict[str, OrderWatch]:
    """Return a watch for every loop whose configuration asks for one."""
    watches = {}
    for name, table in loops.items():
        if table.weighs_orders and table.orders is not None:
            orders = [Order(*each) for each in table.orders.candidates or ()]
            watches[name] = OrderWatch(orders or USUAL, table.period_s, table.power_max)
    return watches
