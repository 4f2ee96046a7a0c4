"""A record in the variables that laws see, never across a gap."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from thermoctl.model.arx import Arx
from thermoctl.quantities import Array
from thermoctl.studies.record import LARGEST, Record, RecordError

MOST_P0 = 1e9
"""Largest P0, in the scaled variables; the least is its inverse."""

MOST_R2 = 1e40
"""Largest R2, in the scaled variables; the least is its inverse."""

_MAD = 1.4826
_BLOCK = 4_096


@dataclass(frozen=True, slots=True)
class Scaling:
    """Scaled output = (y - y_centre)/y_scale, and the input likewise."""

    y_centre: float = 0.0
    y_scale: float = 1.0
    u_centre: float = 0.0
    u_scale: float = 1.0

    @classmethod
    def of(cls, record: Record, *, keep_mean: bool = False) -> Scaling:
        """Return mean and standard deviation of both; with `keep_mean` neither.

        Raises
        ------
        RecordError
            If the output never changes.
        """
        if not moves(record.y):
            raise RecordError(
                f"{record.source}: expected an output that changes,"
                f" {record.names.output} is {record.y[0]:g} throughout"
            )
        if keep_mean:
            return cls()
        u_scale = float(np.std(record.u)) if moves(record.u) else 1.0
        return cls(float(np.mean(record.y)), float(np.std(record.y)), _mean(record.u), u_scale)

    def outputs(self, record: Record) -> Array:
        """Return the scaled outputs, shape (T,)."""
        return (record.y - self.y_centre) / self.y_scale

    def inputs(self, record: Record) -> Array:
        """Return the scaled inputs, shape (T,)."""
        return (record.u - self.u_centre) / self.u_scale


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """Outputs and inputs with the structure that regresses one on the other.

    Regressors are made in blocks, never all at once. `whole` holds the indices of the samples whose
    past reaches back far enough without a gap.
    """

    y: Array
    u: Array
    order: Arx
    whole: npt.NDArray[np.intp]

    @classmethod
    def of(cls, record: Record, y: Array, u: Array, order: Arx, reach: int = 1) -> Scaled:
        """Keep the samples with a whole regressor, and `reach` others, before them."""
        past = np.arange(len(y)) - record.stretch_start
        reach = max(reach, order.y_memory, order.u_memory)
        return cls(y, u, order, np.flatnonzero(past >= reach))

    def blocks(self) -> Iterator[tuple[npt.NDArray[np.intp], Array]]:
        """Yield indices, shape (k,), and their regressors, shape (k, n + m)."""
        back_y = np.arange(1, self.order.n + 1)
        back_u = self.order.delay + np.arange(self.order.m)
        for begin in range(0, len(self.whole), _BLOCK):
            block = self.whole[begin : begin + _BLOCK]
            yield (
                block,
                np.hstack(  # O21 (1)
                    (-self.y[block[:, None] - back_y], self.u[block[:, None] - back_u])
                ),
            )

    def samples(self) -> Iterator[tuple[int, Array, float]]:
        """Yield index, regressor and output of every sample with a whole past."""
        for block, phi in self.blocks():
            yield from zip(block.tolist(), phi, self.y[block].tolist(), strict=True)


def check_P0(P0: float) -> None:  # noqa: N802 - P0 keeps its letter
    """Raise `RecordError` unless P0 lies within `MOST_P0` and its inverse."""
    if not 1.0 / MOST_P0 <= P0 <= MOST_P0:
        raise RecordError(f"expected P0 from {1.0 / MOST_P0:g} to {MOST_P0:g}, got {P0:g}")


def check_R2(R2: float, unit: float) -> None:  # noqa: N802 - R2 keeps its letter
    """Raise `RecordError` unless R2 / `unit` lies within `MOST_R2` and its inverse."""
    if not unit / MOST_R2 <= R2 <= unit * MOST_R2:
        raise RecordError(f"expected R2 from {unit / MOST_R2:g} to {unit * MOST_R2:g}, got {R2:g}")


def moves(values: Array) -> bool:
    """Return whether `values` change, and by enough for their squares to be numbers."""
    return bool(np.ptp(values) > 0.0 and np.std(values) > 1.0 / LARGEST)


def robust_variance(errors: Array, y: Array) -> float:
    """Return the variance of `errors`, at least that of one quantum of `y`.

    The spread is 1.4826 times the median of their sizes, which a few outliers hardly move. A
    quantised record that hardly moves has a median of zero: then one quantum stands in.
    """
    spread = _MAD * float(np.median(np.abs(errors))) if len(errors) else 0.0
    steps = np.abs(np.diff(y))
    quantum = float(np.min(steps[steps > 0.0]))
    return max(spread**2, quantum**2 / 12.0)


def _mean(values: Array) -> float:
    return float(np.mean(values))
