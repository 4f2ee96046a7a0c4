"""Hours of full power, of a heater that this run has never seen obey less.

A gain is told by powers that move. Where one has been at full power since it was first seen to
heat, what rises with it may be the air around a sensor that lies beside its vessel. The gain was an
answer by chance then, and all that is missing of it is put down to a loss. A reading that goes on
rising does not tell the two apart; a cut of some minutes does.
"""

from __future__ import annotations

from thermoctl.quantities import clamp
from thermoctl.regulator.heater.blocks import NEARLY_FULL, Block
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.question import LONGEST_S, LONGEST_SDS, ROUTINE_S
from thermoctl.regulator.heater.response import Gain, Seen

UNBROKEN_S, LONGER, AGAIN_S = 7200.0, 2.0, 450.0
"""Time in s under nearly full power until it is asked, its factor from then on, and that time after
a bad answer: the next one comes within the time in which it latches."""


class Unbroken:
    """Looks at how long there has been full power."""

    def __init__(self, power_max: float = 1.0) -> None:
        self._power_max = power_max
        self._least_s = UNBROKEN_S
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._from: Seen | None = None

    def distrust(self) -> None:
        """Ask soon, after a bad answer."""
        self._least_s = AGAIN_S

    def add(self, block: Block, before: Seen, *, proven: bool) -> None:
        """Take in a block that began with `before`, of a heater that has obeyed or not."""
        if proven or block.power <= NEARLY_FULL * self._power_max:
            self._from = None
        elif self._from is None:
            self._from = before

    def question(self, gain: Gain, now: Seen, sd_k: float) -> Cut | None:
        """Return why to cut the power now, where a cut would tell; nothing is in doubt."""
        start = self._from
        if start is None or now.t_s - start.t_s < self._least_s:
            return None
        self.clear()
        rate = gain.mean * self._power_max
        if rate * ROUTINE_S < LONGEST_SDS * sd_k:
            return None
        self._least_s = max(LONGER * self._least_s, UNBROKEN_S)
        rise_k, span_s = now.reading_c - start.reading_c, now.t_s - start.t_s
        got = f"full power for {span_s / 60.0:.0f} min and {rise_k:+.1f} K"
        before_s = clamp(LONGEST_SDS * sd_k / rate, LONGEST_S, 0.5 * ROUTINE_S)
        why = f"expected less power once, got {got}"
        return Cut(now.t_s, now.t_s - before_s, why, rose=rise_k / span_s)
