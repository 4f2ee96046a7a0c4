"""A controller, together with what it remembers."""

from __future__ import annotations

import math
from typing import Any

from thermoctl.ports import Controller, Foretelling, Knowing, Remembered, Remembering, Situation


class Mind:
    """Keeps the belief of a controller, which a failed call leaves as it was.

    Every method may raise whatever the law raises; who holds the mind stands guard.

    Parameters
    ----------
    controller : Controller
        The law.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.name = controller.name
        self.belief: Any = controller.start()
        self._seen: Situation | None = None
        self._foretells = controller if isinstance(controller, Foretelling) else None
        self.remembers = controller if isinstance(controller, Remembering) else None
        self.knows = controller if isinstance(controller, Knowing) else None

    def recall(self, remembered: Remembered) -> bool:
        """Begin with what an earlier run has learnt; return whether the law can."""
        if self.remembers is None:
            return False
        self.belief = self.remembers.start_from(remembered.model, remembered.age_s)
        return True

    def surprise_k(self, situation: Situation) -> float:
        """Return reading minus what was expected, asked after `observe`; or NaN.

        A law that failed to observe this sample would answer for an earlier one.
        """
        if self._foretells is None or self._seen is not situation:
            return math.nan
        return self._foretells.surprise_k(self.belief, situation)

    def observe(self, situation: Situation) -> None:
        """Show the controller a sample, whether it is in charge or not."""
        self.belief = self.controller.observe(self.belief, situation)
        self._seen = situation

    def decide(self, situation: Situation) -> object:
        """Return what the controller asks for, of whatever kind."""
        self.belief, asked = self.controller.decide(self.belief, situation)
        return asked
