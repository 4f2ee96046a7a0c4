"""The latest readings and powers, and their means over blocks that end now.

The model counts in blocks of `size` samples. Its blocks are not laid out once: they always end at
the newest sample, and slide along with it. So the model is as valid at any sample as it is at
every tenth, and nothing has to be held in between.

Implements section 10 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from thermoctl.quantities import Array, frozen


def _empty() -> Array:
    return frozen(np.empty(0))


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """Readings and powers, newest first; arrays read-only.

    Parameters
    ----------
    readings_c : ndarray, shape (length,)
        Temperatures, with what was expected in place of those that are missing; empty before the
        first reading.
    powers : ndarray, shape (length,)
        What was applied in the period before each of them.
    samples : int
        Samples since the record began.
    blind : int
        Samples in a row without a reading.
    broken : int
        Samples until the last missing reading has left the record.
    """

    readings_c: Array = field(default_factory=_empty)
    powers: Array = field(default_factory=_empty)
    samples: int = 0
    blind: int = 0
    broken: int = 0

    @classmethod
    def begun(cls, length: int, reading_c: float, power: float) -> Record:
        """Return the record of a plant that rested at `reading_c` under `power`."""
        return cls(frozen(np.full(length, reading_c)), frozen(np.full(length, power)), 1)

    @property
    def has_begun(self) -> bool:
        """Whether there was a reading at all."""
        return self.samples > 0

    @property
    def whole(self) -> bool:
        """Whether every reading in it is one, and not made up."""
        return self.broken == 0

    def after(self, reading_c: float, power: float) -> Record:
        """Return the record one sample on."""
        return Record(
            _pushed(self.readings_c, reading_c),
            _pushed(self.powers, power),
            self.samples + 1,
            0,
            max(self.broken - 1, 0),
        )

    def blinded(self, expected_c: float, power: float) -> Record:
        """Return the record one sample on, without a reading but for what was expected."""
        seen = self.after(expected_c, power)
        return replace(seen, blind=self.blind + 1, broken=len(self.readings_c))

    def means_c(self, blocks: int, size: int) -> Array:
        """Return the mean readings of the last `blocks` blocks, newest first."""
        return _means(self.readings_c, blocks, size)

    def mean_powers(self, blocks: int, size: int) -> Array:
        """Return the mean powers of the last `blocks` blocks, newest first."""
        return _means(self.powers, blocks, size)


def _means(values: Array, blocks: int, size: int) -> Array:
    means: Array = values[: blocks * size].reshape(blocks, size).dot(np.full(size, 1.0 / size))
    return means


def _pushed(values: Array, newest: float) -> Array:
    pushed = np.empty_like(values)
    pushed[0] = newest
    pushed[1:] = values[:-1]
    return frozen(pushed)
