"""The gain of a bank, as far as it is fit to be told.

A bank is sure within what it can think of: one lag of its list, a loss that hardly changes, noise
that nobody answers. What is outside of that its standard deviation does not know of.

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math

from thermoctl.quantities import Uncertain
from thermoctl.signals import PlantBelief

SEEN_NOISES = 2.0
"""Least rise within a lag at full power, in deviations of the noise, with which a lag shows."""

GROWTH = 1.5
"""Standard deviation of a gain, as a share of it, over the share of itself by which the loss grows
within a lag; blocks of a few grams with a slow sensor were told up to 2.8 of these too low."""

APART_K = 10.0
"""Least distance from the surroundings that is assumed where the readings moved by less."""


def is_seen(plant: PlantBelief) -> bool:
    """Return whether a lag like this one would show in the readings at all.

    Where full power moves the reading by less than its noise in all that time, the bank takes the
    shape of the noise for a quick plant, and the gain that goes with it is as wrong as the lag.
    """
    return abs(plant.gain_k_per_s) * plant.lag_s > SEEN_NOISES * plant.noise_sd_k


class ToldGain:
    """Widens the gain by what a loss that grows makes of it.

    The loss grows with the distance from the surroundings, which is taken to be the largest
    between two readings so far.
    """

    def __init__(self) -> None:
        self._lowest_c, self._highest_c = math.inf, -math.inf

    def after(self, plant: PlantBelief, reading_c: float) -> Uncertain:
        """Return the gain in K/s that is told; NaN: none.

        Parameters
        ----------
        plant : PlantBelief
            What is believed after the sample.
        reading_c : float
            The reading; NaN where there is none.
        """
        if math.isfinite(reading_c):
            self._lowest_c = min(self._lowest_c, reading_c)
            self._highest_c = max(self._highest_c, reading_c)
        if not is_seen(plant):
            return Uncertain()
        apart_k = max(APART_K, self._highest_c - self._lowest_c)
        most_k_per_s = abs(plant.loss_k_per_s) + 2.0 * plant.loss_sd_k_per_s
        grows = most_k_per_s / apart_k * plant.lag_s
        own = plant.gain_k_per_s
        return Uncertain(own, math.hypot(plant.gain_sd_k_per_s, GROWTH * grows * own))
