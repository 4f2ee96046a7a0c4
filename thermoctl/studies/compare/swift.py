"""The fastest way to a set point, on a plant that is known exactly.

More heat at any time makes everything hotter ever after, so the fastest law that does not leave the
band on its far side is full power until a certain moment and none from then on: the water coasts to
the edge of the band and no farther. That moment is searched on the plant itself, a tank with steady
mains and quiet ice or a lab in a steady room.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

from thermoctl.plant import thermal
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters

LONGEST_S = 172_800.0
"""Beyond two days a set point counts as out of reach."""

_HALVINGS = 30

H = TypeVar("H")
"""Where a plant is: whatever it goes on from."""


class Steppable(Protocol[H]):
    """A plant without noise; more power at any time makes it hotter ever after."""

    @property
    def period_s(self) -> float:
        """Power is constant from one sample to the next, this long."""
        ...

    def advance(self, heat: H, power: float) -> H:
        """Return where it is one period later; `power` is a fraction in [0, 1]."""
        ...

    def bulk_c(self, heat: H) -> float:
        """Return the temperature that is judged."""
        ...


@dataclass(frozen=True, slots=True)
class NoiselessTank:
    """A tank without noise, stepped as the simulated one is.

    Parameters
    ----------
    k : Conductances
        Its coefficients.
    rated_w : float
        Full power.
    period_s : float
        Power is constant from one sample to the next, this long.
    """

    k: thermal.Conductances
    rated_w: float
    period_s: float = 1.0

    @classmethod
    def of(cls, parameters: TankParameters, period_s: float = 1.0) -> NoiselessTank:
        """Return the tank of `parameters`."""
        return cls(thermal.conductances(parameters), parameters.element.rated_w, period_s)

    def advance(self, heat: thermal.Heat, power: float) -> thermal.Heat:
        """Return the heat one period later; `power` is a fraction in [0, 1]."""
        steps = math.ceil(self.period_s / thermal.LONGEST_STEP_S)
        for _ in range(steps):
            heat = thermal.step(self.k, heat, power * self.rated_w, 1.0, self.period_s / steps)
        return heat

    def bulk_c(self, heat: thermal.Heat) -> float:
        """Return the mean temperature of the water."""
        return (heat.water_j + heat.still_j) / (heat.water_kg * WATER_J_PER_KG_K)


@dataclass(frozen=True, slots=True)
class Swift:
    """The fastest approach.

    Parameters
    ----------
    settled_s : float
        Time after which the water is within the band for good.
    switched_s : float
        Time at which the heater is switched off.
    lowest_c : float
        Coldest that the water gets on the way: no power could have kept it warmer.
    """

    settled_s: float
    switched_s: float
    lowest_c: float


def swiftest(
    known: Steppable[H], heat: H, target_c: float, band_k: float = 0.1, peak_k: float = 0.1
) -> Swift | None:
    """Return the fastest way from `heat` to `target_c`; None: it cannot be reached.

    Parameters
    ----------
    known : Steppable
        The plant.
    heat : object
        Where it is.
    target_c : float
        Where it is to be, above where it is.
    band_k : float
        Settled means this close to the target, in K.
    peak_k : float
        How far beyond the target the water may go: the band, or 0 where it must not pass it.
    """
    heated, bulk_c = [heat], [known.bulk_c(heat)]
    rising = False
    while not (rising and bulk_c[-1] >= target_c + peak_k):
        if known.period_s * len(heated) > LONGEST_S:
            return None
        heated.append(known.advance(heated[-1], 1.0))
        bulk_c.append(known.bulk_c(heated[-1]))
        rising = bulk_c[-1] > bulk_c[-2]
    low, high = 0.0, float(len(heated) - 1)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        coast_c = _coast(known, heated, middle)
        low, high = (low, middle) if max(coast_c) > target_c + peak_k else (middle, high)
    # After its peak a plant can be held, so how steeply it would fall without power is no matter.
    path_c = bulk_c[: int(low) + 1] + _coast(known, heated, low)[:-1]
    settled = _settled(path_c, target_c - band_k)
    return Swift(known.period_s * settled, known.period_s * low, min(path_c))


def _coast(known: Steppable[H], heated: list[H], samples: float) -> list[float]:
    """Return the water's temperatures after so many samples of full power, while they rise.

    A part of a sample is that part of full power, which is what a controller could ask for.
    """
    whole, part = divmod(samples, 1.0)
    heat = known.advance(heated[int(whole)], part)
    path_c = [known.bulk_c(heat)]
    while True:
        heat = known.advance(heat, 0.0)
        path_c.append(known.bulk_c(heat))
        if path_c[-1] <= path_c[-2]:
            return path_c


def _settled(path_c: list[float], edge_c: float) -> float:
    """Return the sample, parts included, at which a path passes `edge_c` for the last time."""
    below = [index for index, value in enumerate(path_c) if value < edge_c]
    if not below:
        return 0.0
    last = below[-1]
    if last + 1 == len(path_c):
        return float(last)
    return last + (edge_c - path_c[last]) / (path_c[last + 1] - path_c[last])
