"""What the operator is told of a plant: words, changes, drifts, performance.

`watcher` takes finished steps and hands out an `Insight`; `values` has what that consists of. It
asks, in this order:

- `witness`: what is the plant like, whichever controller is in charge?
- `told_gain`: how much of its gain is fit to be told?
- `gate`: did the last samples teach anything?
- `rest`: is the loop at its set point, and since when? `restless`: why does it never get there?
- `samples` keeps the last hours; `lagged_power` is the power as the sensor comes to feel it.
- `assay_schedule`: is it time to estimate the gain anew? `assay` does so, by regression.
- `changes`: did heat come or go that nobody gave or took? `change_words` says how much it was, and
  `physics` what that is in water or ice.
- `drifts`: has a quantity left what it was? `faults`: which fault does that look like?
- `performance`: how near is the loop to minimum variance? `harris` has the index, `swing` finds a
  cycle.
- `rows` are the quantities of the plant for display, `wording` their digits.
"""

from thermoctl.insight.values import Change, Drift, Gate, Insight, Limit, Performance, Row
from thermoctl.insight.watcher import Insights

__all__ = ["Change", "Drift", "Gate", "Insight", "Insights", "Limit", "Performance", "Row"]
