"""Heat that an output gives beyond its commands, kept as an account.

An output that is late and one that is stuck report the same; what tells them apart is how much they
go on to give. A relay that takes its duty once in ten seconds, or stays on for ten at least, gives
no more than ten seconds of full power beyond its commands. What is stuck goes on.
"""

from __future__ import annotations

from typing import NamedTuple

_IN_A_ROW = 2
"""Number of reports in a row beyond the command that are a fault; a single one may be a slip of the
line."""


class Overdrawn(NamedTuple):
    """Account of the reports of an output, since it last owed nothing.

    Parameters
    ----------
    reports : int
        Reports beyond their commands, in a row.
    beyond : float
        By how much of full power the last one was; at most 0: it was in order.
    heat_s : float
        Heat given beyond the commands and not paid back, in seconds of full power.
    lasted_s : float
        For how long reports have been beyond their commands without a break.
    stuck : bool
        Whether that is a fault.
    """

    reports: int = 0
    beyond: float = 0.0
    heat_s: float = 0.0
    lasted_s: float = 0.0
    stuck: bool = False

    def after(self, beyond: float, interval_s: float, window_s: float) -> Overdrawn:
        """Return the account at a report that comes `interval_s` after the last one.

        What the last report said went on until now. A second in order pays back a second of full
        power and no more, so that an output which sticks nine seconds out of ten is found as well
        as one that sticks for good; an output that is only late pays it all, for it is late in the
        other direction too. Nobody waits for more than `window_s`, so no more is owed.
        """
        if self.beyond > 0.0:
            heat_s = min(self.heat_s + self.beyond * interval_s, window_s)
            lasted_s = self.lasted_s + interval_s
        else:
            heat_s, lasted_s = max(self.heat_s - interval_s, 0.0), 0.0
        reports = self.reports + 1 if beyond > 0.0 else 0
        stuck = reports >= _IN_A_ROW and heat_s >= window_s
        return Overdrawn(reports, beyond, heat_s, lasted_s, stuck)

    @property
    def settled(self) -> bool:
        """Whether the output is in order and owes nothing."""
        return self.beyond <= 0.0 and self.heat_s == 0.0


IN_ORDER = Overdrawn()
