"""A heater and a cooler of one plant, each watched while the other one is off.

To the watch over one of them the other is something that moves the reading for no reason that it
knows. So it stands aside as long as the other one gives power, and then begins again like after a
gap: what it has learnt stays, and nothing is compared before what the other one gave has arrived.
That way either is judged by its own gain, and nobody has to know how strong the one is beside the
other. While both are off both are watched, and whoever asks a question has both off.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from thermoctl.regulator.heater import memory
from thermoctl.regulator.heater.check import HeaterCheck, Reacts
from thermoctl.regulator.heater.led import LedWatch
from thermoctl.regulator.heater.watch import OFF, HeaterWatch
from thermoctl.regulator.supervisor import Emit

_COOLER: Final = "cooler: "


class Sides:
    """Watches a heater, for power above 0, and a cooler, for power below.

    Parameters
    ----------
    check : HeaterCheck
        What is admissible.
    period_s : float
        Nominal time between two samples.
    supervisor : Reacts
        Who is told of a fault.
    emit : callable
        Called as ``emit(name, **fields)`` when a question is put, and when it is answered well.
    """

    def __init__(self, check: HeaterCheck, period_s: float, supervisor: Reacts, emit: Emit) -> None:
        self._emit = emit
        self.heater = HeaterWatch(check.of_heater, period_s, supervisor, emit)
        reacts = _OfCooler(supervisor)
        self.cooler = HeaterWatch(check.of_cooler, period_s, reacts, self._emit_of_cooler)
        self._acts = 0  # 1 the heater, -1 the cooler, 0 neither

    @property
    def asks(self) -> bool:
        """Whether power has to be 0 now, for the sake of a question."""
        return self.heater.asks or self.cooler.asks

    @property
    def ceiling_c(self) -> float:
        """Reading in degC that all the power does not pass; NaN before one was seen."""
        return self.heater.ceiling_c

    def observe(self, t_s: float, interval_s: float, reading_c: float, applied: float) -> None:
        """Show the last interval and the reading at its end to the watch concerned."""
        acts = int(applied > OFF) - int(applied < -OFF)
        if acts != self._acts:
            self._acts = acts
            if acts != 0:
                aside = self.cooler if acts > 0 else self.heater
                aside.stand_aside(max(self.heater.under_way_s, self.cooler.under_way_s))
        if acts >= 0:
            self.heater.observe(t_s, interval_s, reading_c, max(applied, 0.0))
        if acts <= 0:
            self.cooler.observe(t_s, interval_s, reading_c, max(-applied, 0.0))

    def _emit_of_cooler(self, name: str, *, text: str) -> None:
        self._emit(name, text=_COOLER + text)


class _OfCooler:
    """A supervisor that is told that the cooler is meant."""

    def __init__(self, supervisor: Reacts) -> None:
        self._supervisor = supervisor

    def fail(self, code: str, fault: int | None, text: str, t_s: float) -> None:
        self._supervisor.fail(code, fault, _COOLER + text, t_s)

    def latch(self, code: str, fault: int | None, text: str, t_s: float) -> None:
        self._supervisor.latch(code, fault, _COOLER + text, t_s)


Watch = HeaterWatch | LedWatch | Sides
"""What watches the one actuator of a loop, the block that acts in its place, or both."""


def watch_for(check: HeaterCheck, period_s: float, supervisor: Reacts, emit: Emit) -> Watch:
    """Return what watches the actuators of a loop."""
    if check.block_c is not None:
        return LedWatch(check, period_s, supervisor, emit)
    kind = Sides if check.action == "heat-cool" else HeaterWatch
    return kind(check, period_s, supervisor, emit)


Named = Mapping[str, HeaterWatch | LedWatch]


def named(watch: Watch | None) -> Named:
    """Return every watch by the name under which it remembers what it knows."""
    if isinstance(watch, Sides):
        return {memory.NAME: watch.heater, memory.COOLER_NAME: watch.cooler}
    return {} if watch is None else {memory.NAME: watch}
