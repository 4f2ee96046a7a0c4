"""A request on its way to the loop, and the answer on its way back."""

from __future__ import annotations

from thermoctl.signals import Request

_UNFINISHED = "the cycle that took it failed"


class Asked:
    """A request in the loop's queue; its asker may look at it or withdraw it.

    The loop and the asker race for it: the first of the two decides whether it is granted or
    withdrawn, and neither ever waits for the other, because popping a list is one step.

    Parameters
    ----------
    request : Request
        What is wanted.
    loop : str or None
        The loop that is asked; None: all of them.
    """

    def __init__(self, request: Request, loop: str | None = None) -> None:
        self.request, self.loop = request, loop
        self._open = [True]
        self._refusal: str | None = _UNFINISHED
        self._settled = False

    def claim(self) -> bool:
        """Take it for good; return whether nobody has before. Called by the loop."""
        try:
            return self._open.pop()
        except IndexError:
            return False

    withdraw = claim
    """Take it back; True: the loop will never grant it, False: it already has it."""

    def decide(self, refusal: str | None) -> None:
        """Note what became of it: None when granted. Called by the loop."""
        self._refusal = refusal

    def settle(self) -> None:
        """Let the asker see the answer; called by the loop once the cycle is published."""
        self._settled = True

    @property
    def settled(self) -> bool:
        """Whether there is an answer, and a published cycle that shows what came of it."""
        return self._settled

    @property
    def refusal(self) -> str | None:
        """Why it was refused, None when granted; only worth reading once it is settled."""
        return self._refusal
