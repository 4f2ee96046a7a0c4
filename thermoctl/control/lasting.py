"""A condition that flickers, debounced."""

from __future__ import annotations

from dataclasses import dataclass, replace

APPEARS_AFTER = 3
"""Number of samples in a row that make a condition stand."""
GONE_AFTER = 60
"""Number of samples in a row without it that end it."""


@dataclass(frozen=True, slots=True)
class Lasting:
    """Whether a condition stands, slower to end than to begin.

    An estimate that moves to and fro across a bound would otherwise be news at every crossing.

    Parameters
    ----------
    stands : bool
        Whether it stands.
    contrary : int
        Samples in a row that said the opposite.
    text : str
        What was seen when it began.
    """

    stands: bool = False
    contrary: int = 0
    text: str = ""

    def after(self, text: str) -> Lasting:
        """Return the condition after one more sample; empty `text`: it was not met."""
        if bool(text) is self.stands:
            return replace(self, contrary=0) if self.contrary else self
        if self.contrary + 1 < (GONE_AFTER if self.stands else APPEARS_AFTER):
            return replace(self, contrary=self.contrary + 1)
        return Lasting(bool(text), 0, text)
