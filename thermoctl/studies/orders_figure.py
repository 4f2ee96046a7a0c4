"""A panel that shows how the probabilities of orders went."""

from __future__ import annotations

from typing import Any

import numpy as np

from thermoctl.studies import figure as house
from thermoctl.studies.orders import SETTLED, Weighing
from thermoctl.studies.orders_words import order_text, percent
from thermoctl.studies.record import GAP, Record

_LEADING = 4
_LABEL_GAP = 0.13
_NOTABLE = 0.02


def draw_posterior(panel: Any, weighing: Weighing, record: Record, unit_s: float) -> None:
    """Draw into `panel` how the probabilities of the leading candidates went.

    Leading are those that are most probable at the end, and those that once were.
    """
    places = _leading(weighing)
    longest = GAP * record.period_s / unit_s
    stride = max(1, int(np.max(np.diff(weighing.index), initial=1)))
    ends = [float(weighing.trace[-1, place]) for place in places]
    for place, hue, dash in zip(places, house.HUES, house.DASHES, strict=False):
        t, p = house.broken(
            record.t_s[weighing.index] / unit_s, weighing.trace[:, place], stride * longest
        )
        panel.plot(*house.envelope(t, p), color=hue, linestyle=dash)
    apart = house.spread_out(ends, _LABEL_GAP, low=0.0)
    for place, y, hue in zip(places, apart, house.HUES, strict=False):
        house.label(panel, y, order_text(weighing.orders[place]), hue)
    panel.axhline(SETTLED, color=house.ALLOWED, linewidth=0.8, zorder=0)
    words: Any = {"transform": panel.get_yaxis_transform(), "va": "top", "fontsize": 6.5}
    panel.text(0.006, SETTLED - 0.02, f"settled: {percent(SETTLED)}", color=house.MUTE, **words)
    panel.set_ylim(-0.03, 1.05)
    panel.set_yticks((0.0, 0.5, 1.0))
    panel.set_ylabel("probability")
    best, probability = weighing.ranked[0]
    verdict = "undecided" if weighing.undecided else f"{order_text(best)} {percent(probability)}"
    house.score(panel, f"{len(weighing.orders)} orders n,m,d · {verdict}")


def _leading(weighing: Weighing) -> list[int]:
    """Return the places of at most four candidates worth a line, the best first."""
    last = np.argsort(-weighing.posterior, kind="stable")[:_LEADING]
    once = np.argsort(-weighing.trace.mean(axis=0), kind="stable")[:_LEADING]
    notable = [place for place in last.tolist() if weighing.posterior[place] > _NOTABLE]
    return list(dict.fromkeys((int(last[0]), *notable, *once.tolist())))[:_LEADING]
