"""Whether power warms the water at all, judged by the readings alone.

A model that is kept to gains above 0 cannot say that power cools, and its least gain would mean
full power for as long as it is too cold. So a plant whose heater is dead, or whose sensor hangs in
the air, is told by what it does: it goes on falling under full power.

Implements section 10 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

NEARLY_FULL = 0.9
"""Share of the most power from which on it is meant to warm."""
UNSEEN_BLOCKS, JUDGED_BLOCKS = 8, 8
"""Number of blocks of such power that the lag may hide, and least number that are judged."""
FALLEN_K, RISEN_K = 0.05, 0.2
"""Fall in K that is a doubt, and rise in K from the lowest reading that ends it."""
PAUSE_BLOCKS, TRIAL_BLOCKS = 180, 16
"""Number of blocks in doubt until full power is tried again, and of that trial: otherwise nobody
would notice that a heater was mended."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """What became of full power.

    Parameters
    ----------
    samples : int
        Samples of nearly full power in a row; in doubt, since it began.
    from_c : float
        Mean reading when judging began; in doubt the lowest.
    text : str
        What was seen; empty: power warms as far as anybody knows.
    """

    samples: int = 0
    from_c: float = math.nan
    text: str = ""

    @property
    def stands(self) -> bool:
        """Whether power seems not to warm."""
        return bool(self.text)

    def holds_back(self, size: int) -> bool:
        """Return whether the power is to be limited, with `size` samples in a block."""
        cycle = (PAUSE_BLOCKS + TRIAL_BLOCKS) * size
        return self.stands and self.samples % cycle < PAUSE_BLOCKS * size

    def after(self, now_c: float, share: float, size: int) -> Doubt:
        """Return what is known one sample on.

        Parameters
        ----------
        now_c : float
            Mean of the last block of readings.
        share : float
            Mean power of that block over the most there is.
        size : int
            Samples in a block.
        """
        samples = self.samples + 1
        if self.stands:
            lowest_c = min(self.from_c, now_c)
            if now_c > lowest_c + RISEN_K:
                return Doubt()
            return replace(self, samples=samples, from_c=lowest_c)
        if share < NEARLY_FULL:
            return self if self.samples == 0 else Doubt()
        if samples <= UNSEEN_BLOCKS * size:
            return Doubt(samples, now_c)
        fallen_k = self.from_c - now_c
        if samples < (UNSEEN_BLOCKS + JUDGED_BLOCKS) * size or fallen_k < FALLEN_K:
            return Doubt(samples, self.from_c)
        text = f"expected full power to warm, got {fallen_k:.2g} K less after {samples} samples"
        return Doubt(0, now_c, text)
