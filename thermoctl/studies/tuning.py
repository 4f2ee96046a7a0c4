"""What a run through a test signal teaches: order, parameters, plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from thermoctl.estimation import Order
from thermoctl.studies.laws import parse_law
from thermoctl.studies.orders import Weighing, weigh
from thermoctl.studies.plant_words import LAGS, REACH, PlantWords, plant_words
from thermoctl.studies.record import Record
from thermoctl.studies.replay import Score, replay
from thermoctl.studies.wide import samples_needed

_LAW = parse_law("nkf")
"""The normal filter without drift: over a record it is least squares, with honest error bars."""


@dataclass(frozen=True, slots=True, eq=False)
class Tuning:
    """What a record teaches of the loop it was made with.

    Parameters
    ----------
    record : Record
        Temperature in degC, and the power that was applied as a fraction.
    weighing : Weighing
        What it says of the candidates; of one only where the order was given.
    score : Score
        Parameters of the most probable order, and how well they foresaw the record.
    words : PlantWords or None
        The plant in words, where the record says anything of it.
    """

    record: Record
    weighing: Weighing
    score: Score
    words: PlantWords | None

    @property
    def order(self) -> Order:
        """The order that was given, or the most probable."""
        return self.weighing.best

    @property
    def given(self) -> bool:
        """Whether the order was given, and nothing chosen."""
        return len(self.weighing.orders) == 1


def tune(record: Record, candidates: Sequence[Order], setpoint_c: float) -> Tuning:
    """Return what `record` teaches.

    Parameters
    ----------
    record : Record
        Temperature in degC, and the power that was applied as a fraction.
    candidates : sequence of Order
        Orders to weigh; a single one is taken as given.
    setpoint_c : float
        Temperature the loop is to hold, in degC.

    Raises
    ------
    RecordError
        If the temperature never changes, or too few samples have a whole past.
    """
    weighing = weigh(record, candidates)
    result = replay(record, weighing, [_LAW])
    words = plant_words(record, setpoint_c, _reach(candidates))
    return Tuning(record, weighing, result.scores[0], words)


def needed(candidates: Sequence[Order]) -> int:
    """Return how many samples without a gap `tune` takes at least."""
    return samples_needed(max(LAGS, *(order.n for order in candidates)), _reach(candidates))


def _reach(candidates: Sequence[Order]) -> int:
    return max(REACH, *(order.structure().u_memory for order in candidates))
