"""A loop that heats by the temperature of a block, watched by its flow of heat.

The power of such a loop is the place of the block between two temperatures. That is not the heat
that flows: a bath as warm as the block gets none, and a block in a bath of 37 °C never cools to the
20 °C of power 0. By that power the bath would seem to lose half of what it gets, and a reading that
stands still would hardly be missed. The heat that flows follows the difference of block and bath,
and is 0 when the block is asked for nothing.
"""

from __future__ import annotations

import math

from thermoctl.quantities import clamp
from thermoctl.regulator.heater.check import HeaterCheck, Reacts
from thermoctl.regulator.heater.response import Gain
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.supervisor import Emit


class LedWatch:
    """Watches a bath that a block heats.

    Parameters
    ----------
    check : HeaterCheck
        What is admissible, with the temperatures of the block at power 0 and 1.
    period_s : float
        Nominal time between two samples.
    supervisor : Reacts
        Who is told of a fault.
    emit : callable
        Called as ``emit(name, **fields)`` when a question is put, and when it is answered well.

    Raises
    ------
    ValueError
        The temperatures of the block are not given.
    """

    def __init__(self, check: HeaterCheck, period_s: float, supervisor: Reacts, emit: Emit) -> None:
        if check.block_c is None:
            raise ValueError("block_c must be given where a block heats, got None")
        self._low_c, high_c = check.block_c
        self._span_k = high_c - self._low_c
        self._bath_c = math.nan
        self.inner = HeaterWatch(check, period_s, supervisor, emit)

    @property
    def asks(self) -> bool:
        """Whether the block has to be asked for nothing now, for the sake of a question."""
        return self.inner.asks

    @property
    def known(self) -> Gain | None:
        """What is known of the block, once it is."""
        return self.inner.known

    @property
    def ceiling_c(self) -> float:
        """Reading in degC that all the power does not pass; NaN before one was seen."""
        return self.inner.ceiling_c

    def recall(self, known: Gain) -> None:
        """Begin with what an earlier run knew."""
        self.inner.recall(known)

    def observe(self, t_s: float, interval_s: float, reading_c: float, applied: float) -> None:
        """Show the last interval and the reading at its end."""
        if math.isfinite(reading_c):
            self._bath_c = reading_c
        level = (self._bath_c - self._low_c) / self._span_k
        flows = clamp(applied - level, 0.0, 1.0) if math.isfinite(level) else 0.0
        self.inner.observe(t_s, interval_s, reading_c, flows)
