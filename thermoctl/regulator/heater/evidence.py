r"""What readings say of a heater while loads come and go.

A lid that is lifted or a tap that is opened bends the reading as sharply as the power does, and
where the power has grown to make up for it, by just as much. A parabola cannot tell the one from
the other. How often and how sharply a reading bends it tells itself, over some minutes:

.. math:: y = \beta H_j + \int d\,dt + e, \qquad dd = \sigma\,dw

The rate d at which the plant moves without power is a random walk. So is part of e, what a reading
is off by, for a sensor in air wanders; the rest is noise. For a grid of both walks a Kalman filter
makes innovations of the reading, and of the heat under every lag. In these the gain beta is a
regression through the origin, and the likelihood of any beta follows from three sums. Of two
claims, that the heater is sound and that it does nothing, each has the walks and the lag that suit
it best. A reading that never moves needs no walk if the heater is dead; if the heater were sound,
some load would have to undo all it does. A reading that dips and is brought back by more power says
the opposite.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from thermoctl.quantities import Array
from thermoctl.regulator.heater.known import CHANGED
from thermoctl.regulator.heater.question import Answer, near, or_longer
from thermoctl.regulator.heater.response import Gain, Seen

SOUND, SURE = 5.0, 3.0
"""Log odds above which a heater is sound, 150 to one, and above which the likelier claim counts as
true, twenty to one. Once in a while a sensor that wanders in another vessel looks like an
answer."""
BEFORE_LAGS = 2.0
"""Time before the power began to grow that counts too, in lags: the dip comes first."""
ROWS_LEAST = 12
WALKS = np.meshgrid((0.0, 1e-2, 1e-1, 1.0), 10.0 ** np.arange(-8.0, 1.0))
OFF, MOVES = WALKS[0].ravel(), WALKS[1].ravel()
"""Growth per second of the variances of e and d, in variances of a reading and of a reading per
second. The first value of each is next to none."""
DIFFUSE = 1e8
"""Variance of a state that is not known at all: the first reading, and the first d."""
JUMP_SDS = 5.0
"""Standard deviations by which a block may move beyond what full power does. A larger move is
another sensor or vessel, no load, and what was before it does not count."""


def odds(
    rows: Iterable[Seen], from_s: float, known: Gain, sd_k: float, *, late: bool = False
) -> float:
    """Return the log of the odds of a sound heater to one that does nothing.

    Parameters
    ----------
    rows : iterable of Seen
        Readings; those since `from_s` are meant.
    from_s : float
        Time in s.
    known : Gain
        What the heater did when it was sound; most of that is sound still.
    sd_k : float
        Standard deviation of a reading, in K, above 0.
    late : bool
        Whether its lag may have become any longer one.

    Returns
    -------
    float
        Above 0 it is rather sound, below rather dead or reversed; 0 for too few readings.
    """
    meant = _since_jump([row for row in rows if row.t_s >= from_s], known, sd_k)
    if len(meant) < ROWS_LEAST:
        return 0.0
    places = or_longer(known) if late else near(known)
    n, sizes, squares, products, heats = _innovations(meant, places, sd_k)
    best = products / heats

    def likelihood(gain: Array) -> float:
        rest = squares - gain * (2.0 * products - gain * heats)
        scale = np.maximum(rest / n, 1.0)  # the noise may be larger than `sd_k` says
        return float((-0.5 * (sizes + n * np.log(scale) + rest / scale)).max())

    sound = likelihood(np.maximum(best, CHANGED * known.mean))
    return sound - likelihood(np.minimum(best, 0.0))


def weigh(answer: Answer, log_odds: float, *, crept: bool, late: bool) -> Answer:
    """Return `answer`, corrected where a load may have caused it.

    An answer that is late is one, unless what came before denies it. A reading that does not
    answer, while all that came before says it did, is bent by a load. Where
    nothing but the power that holds a reading has grown, it `crept`, any load that ends at the
    right moment gives a bad answer, and it has to be better than that. Longer waiting does not make
    it so; what is likelier by then, `late`, is taken.
    """
    if log_odds > (0.0 if answer is Answer.LATE else SOUND):
        return Answer.HEATS
    if answer is Answer.LATE:
        return Answer.OPEN
    if not crept:
        return answer
    if log_odds < -SURE:
        return Answer.NOTHING if answer is Answer.HEATS else answer
    if log_odds > (0.0 if late else SURE):
        return Answer.HIDDEN
    return answer if late else Answer.OPEN


def _since_jump(rows: Sequence[Seen], known: Gain, sd_k: float) -> Sequence[Seen]:
    """Return what was seen after the last jump."""
    for place in range(len(rows) - 1, 0, -1):
        before, now = rows[place - 1], rows[place]
        most_k = known.mean * (now.t_s - before.t_s) + JUMP_SDS * sd_k
        if abs(now.reading_c - before.reading_c) > most_k:
            return rows[place:]
    return rows


def _innovations(
    rows: Sequence[Seen], places: Iterable[int], sd_k: float
) -> tuple[int, Array, Array, Array, Array]:
    """Filter readings and heat by one Kalman filter for every pair of walks.

    Returns
    -------
    n : int
        How many innovations there are.
    sizes : array, shape (walks, 1)
        Sum of the logs of their variances.
    squares : array, shape (walks, 1)
        Their squares over their variances, of the reading.
    products, heats : array, shape (walks, lags)
        The same of reading times heat, and of the heat.
    """
    t_s = [row.t_s for row in rows]
    seen = np.array([[row.reading_c, *(row.heat_s[place] for place in places)] for row in rows])
    seen = (seen - seen[0]) / sd_k
    level, rate, crosses, squares = np.zeros((4, len(MOVES), seen.shape[1]))
    sizes, both = np.zeros((2, len(MOVES)))
    own, own_rate = np.full((2, len(MOVES)), DIFFUSE)
    for place, now in enumerate(seen):
        span_s = t_s[place] - t_s[place - 1] if place else 0.0
        level = level + span_s * rate
        own = own + span_s * (2.0 * both + span_s * own_rate)
        own = own + span_s * OFF + span_s**3 / 3.0 * MOVES
        both = both + span_s * own_rate + span_s**2 / 2.0 * MOVES
        own_rate = own_rate + span_s * MOVES
        size, new = own + 1.0, now - level
        if place >= 2:  # the first two fix where it begins
            part = new / size[:, None]
            crosses += part * new[:, :1]
            squares += part * new
            sizes += np.log(size)
        level = level + (own / size)[:, None] * new
        rate = rate + (both / size)[:, None] * new
        own, both, own_rate = own / size, both / size, own_rate - both * both / size
    heats = np.maximum(squares[:, 1:], 1e-12)
    return len(rows) - 2, sizes[:, None], crosses[:, :1], crosses[:, 1:], heats
