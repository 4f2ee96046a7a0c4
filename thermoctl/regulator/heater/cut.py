"""A question that is being put: since when the power is cut, and why."""

from __future__ import annotations

from typing import NamedTuple


class Cut(NamedTuple):
    """A cut of the power.

    Parameters
    ----------
    at_s, from_s : float
        When it began, and since when readings are looked at for the answer.
    why : str
        What was expected, and what came.
    wild : bool
        Whether the reading fell faster than any heater can make it.
    began_s : float or None
        Since when there was a doubt, where a load may be the reason of it.
    crept : bool
        Whether nothing is in doubt but why the power that holds the reading has grown.
    portion : bool
        Whether a little heat was given first, after a bad answer, to a reading that stood still.
    quiet : bool
        Whether nobody is told yet: the next heat was announced as the question.
    stands : bool
        Whether the plant may be at what it can reach, where little is left of its gain.
    rose : float or None
        How fast the reading rose in K/s, where hours of full power are all there is to ask about:
        nothing is in doubt then, an answer that stays open is left open, and a rise proves nothing:
        walls give off heat for longer than any lag.
    """

    at_s: float
    from_s: float
    why: str
    wild: bool = False
    began_s: float | None = None
    crept: bool = False
    portion: bool = False
    quiet: bool = False
    stands: bool = False
    rose: float | None = None

    @property
    def teaches(self) -> bool:
        """Whether a good answer shows a gain, rather than what is left of one."""
        return not self.stands and self.rose is None
