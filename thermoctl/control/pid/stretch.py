"""A stretch of powers and temperatures that a test looks at afterwards.

Its length is bounded: once it is full, neighbours are joined, and it goes on half as dense.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from thermoctl.quantities import Array

PIECES_MAX = 512


@dataclass(frozen=True, slots=True)
class Piece:
    """One interval, with the mean power in it and the temperature at its end.

    Parameters
    ----------
    length_s : float
        Its length.
    power : float
        What was applied, as a fraction.
    reading_c : float
        Temperature at its end; NaN when there was no reading.
    """

    length_s: float
    power: float
    reading_c: float

    def joined(self, later: Piece) -> Piece:
        """Return this interval and the one after it as one."""
        length_s = self.length_s + later.length_s
        given_s = self.power * self.length_s + later.power * later.length_s
        return Piece(length_s, given_s / length_s, later.reading_c)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Intervals one after the other, without the reading before the first.

    Parameters
    ----------
    pieces : tuple of Piece
        At most `PIECES_MAX`.
    shortest_s : float
        An interval shorter than this takes the next one in.
    """

    pieces: tuple[Piece, ...] = ()
    shortest_s: float = 0.0

    def after(self, piece: Piece) -> Stretch:
        """Return the stretch with one more interval; one without length is left out."""
        if not piece.length_s > 0.0:
            return self
        if self.pieces and self.pieces[-1].length_s < self.shortest_s:
            return Stretch((*self.pieces[:-1], self.pieces[-1].joined(piece)), self.shortest_s)
        if len(self.pieces) < PIECES_MAX:
            return Stretch((*self.pieces, piece), self.shortest_s)
        pairs = zip(self.pieces[::2], self.pieces[1::2], strict=True)
        thinned = tuple(first.joined(second) for first, second in pairs)
        shortest_s = 0.75 * min(each.length_s for each in thinned)
        return Stretch((*thinned, piece), shortest_s)

    @property
    def length_s(self) -> float:
        """How long it is."""
        return sum(piece.length_s for piece in self.pieces)

    def since_s(self, power: float) -> float:
        """Return for how long the power has been less than `power`."""
        low = itertools.takewhile(lambda piece: piece.power < power, reversed(self.pieces))
        return sum(piece.length_s for piece in low)

    def last(self, length_s: float) -> Stretch:
        """Return its last `length_s` in whole intervals, one more where they are not."""
        kept, reached_s = [], 0.0
        for piece in reversed(self.pieces):
            if reached_s >= length_s:
                break
            kept.append(piece)
            reached_s += piece.length_s
        return Stretch(tuple(reversed(kept)), self.shortest_s)

    def times_s(self) -> Array:
        """Return the ends of all intervals, after a leading 0; shape (pieces + 1,)."""
        lengths_s = [piece.length_s for piece in self.pieces]
        return np.concatenate(((0.0,), np.cumsum(lengths_s)))

    def given_s(self) -> Array:
        """Return the integral of power up to each of these times; shape (pieces + 1,)."""
        given_s = [piece.length_s * piece.power for piece in self.pieces]
        return np.concatenate(((0.0,), np.cumsum(given_s)))

    def readings_c(self) -> Array:
        """Return the temperatures at the ends, NaN where there is none; shape (pieces,)."""
        return np.array([piece.reading_c for piece in self.pieces])
