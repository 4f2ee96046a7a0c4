"""Whether a plant that gets no power comes back from beyond its set point.

A balance of heat learns whatever goes on for long: an output that is stuck on becomes a plant that
loses nothing and that no power moves, and one that stands far beyond its set point is then in
order. What it lost before the power went, and what power did, is not learnt from what came after. A
plant that is left alone loses a good part of that, as long as it is not colder; one that does not
is heated by something else.

Where no loss is believed, at the temperature of the air or of a heater that never had to heat,
nothing is missing, and the plant may stand there for ever. That needs no balance to be known: one
mean of half an hour after the other says whether it is on its way at all. A large tank that cools
is, however slow, and sways less within half an hour than a sample does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.quantities import clamp
from thermoctl.regulator.balance.heat_belief import WARMS_AT_MOST_K
from thermoctl.regulator.heater.known import OFF_LAGS
from thermoctl.regulator.heater.response import LAGS_S

WAITS_S = OFF_LAGS * LAGS_S[-1]
"""Time in s without power after which no heat is under way, whatever the lag."""
LOSES = 0.1
"""Least share of the believed loss that must remain: in a warm-up a cold wall may take five times
what is lost, and in the end it is warm."""
LEFT_K, LEFT_SDS = 0.5, 5.0
"""The missing fall is a doubt beyond both, in K and in standard deviations of a reading."""
MOST = 2.0
"""Most that is added up, in such limits, so that the doubt is soon over when the plant comes
back."""

PATIENCE_S = 864_000.0
"""Time in s, ten days: what is not reached in it at the present rate is never reached."""
MEAN_S = 1800.0
"""Length in s of the means that are compared: draughts and showers are shorter."""


class Beyond(NamedTuple):
    """A plant beyond its set point, counted in the direction in which power drives.

    Parameters
    ----------
    reading_c : float
        Where it is.
    gain, loss : float
        Rate at full power and the opposite one without, in K/s, as they are believed now; 0 where
        they are not known. What counts are those of the moment when the power went.
    """

    reading_c: float
    gain: float
    loss: float


class LeftAlone:
    """Follows a plant from the moment on when it gets no power."""

    def __init__(self) -> None:
        self._lowest_c = math.inf
        self.clear()

    def clear(self) -> None:
        """Begin anew when there is no power the next time."""
        self._alone_s = self._missing_k = self._loss = self._gain = 0.0
        self._from_c = self._before_c = self._last_mean_c = math.nan
        self._mean_s = self._total_cs = self._stays = 0.0

    def seen(self, reading_c: float) -> None:
        """Take in the reading; at the lowest one the plant may be at rest."""
        self._lowest_c = min(self._lowest_c, reading_c)

    @property
    def waited(self) -> bool:
        """Whether all heat has arrived, also that from before a start."""
        return self._alone_s > WAITS_S

    @property
    def knows(self) -> bool:
        """Whether the gain was known when the power went, and drives the right way."""
        return self._gain > 0.0

    def missing(self, beyond: Beyond, span_s: float, sd_k: float) -> float:
        """Return how much is missing after another `span_s` without power; 1 is a doubt.

        Parameters
        ----------
        beyond : Beyond
            The plant at the end of it.
        span_s : float
            How long, in s.
        sd_k : float
            Standard deviation of its reading.
        """
        reading_c, before_c = beyond.reading_c, self._before_c
        if math.isnan(self._from_c):
            least = beyond.gain * (reading_c - self._lowest_c) / WARMS_AT_MOST_K
            self._from_c, self._loss = reading_c, max(beyond.loss, least)
            self._gain = beyond.gain
        self._alone_s += span_s
        self._before_c = reading_c
        limit_k = max(LEFT_K, LEFT_SDS * sd_k)
        if self.waited and self._loss > 0.0:
            rise_k = min(reading_c - before_c, self._gain * span_s)  # hot water is no fault
            missing_k = self._missing_k + rise_k + LOSES * self._loss_at(reading_c) * span_s
            self._missing_k = clamp(missing_k, 0.0, MOST * limit_k)
        return self._missing_k / limit_k

    def stays(self, reading_c: float, way_k: float, span_s: float) -> float:
        """Return how surely it does not come back at all; 1 is a doubt, as for `missing`.

        Parameters
        ----------
        reading_c : float
            The plant at the end of another `span_s` without power.
        way_k : float
            How far it still is from its set point, in K.
        span_s : float
            How long, in s.
        """
        if not self.waited:
            return 0.0
        self._mean_s += span_s
        self._total_cs += span_s * reading_c
        if self._mean_s >= MEAN_S:
            mean_c = self._total_cs / self._mean_s
            least_k = way_k * self._mean_s / PATIENCE_S
            fell_k = self._last_mean_c - mean_c
            if not math.isnan(fell_k):
                self._stays = least_k / max(fell_k, least_k / MOST)
            self._last_mean_c, self._mean_s, self._total_cs = mean_c, 0.0, 0.0
        return self._stays

    def _loss_at(self, reading_c: float) -> float:
        """Return what it lost at the beginning, less in proportion where it is colder by now."""
        if reading_c >= self._from_c:
            return self._loss
        return self._loss * (reading_c - self._lowest_c) / (self._from_c - self._lowest_c)
