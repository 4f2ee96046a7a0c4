r"""The Temperature Control Lab, simulated: two heaters and sensors on a board.

The energy balance that J. D. Hedengren's group publishes with it (apmonitor.com/heat.htm), a
temperature for each heater, convection, radiation and what passes between the two:

.. math::
    m c_p \dot T_1 = U A (T_a - T_1) + \epsilon \sigma A (T_a^4 - T_1^4) + q_{12} + \alpha_1 Q_1

    m c_p \dot T_2 = U A (T_a - T_2) + \epsilon \sigma A (T_a^4 - T_2^4) - q_{12} + \alpha_2 Q_2

    q_{12} = U A_s (T_2 - T_1) + \epsilon \sigma A_s (T_2^4 - T_1^4)

The sensor follows its heater with a lag that the published balance leaves out. The first heater is
the one that is controlled; the second is a disturbance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from numpy.random import Generator

from thermoctl.model.sensor import TMP36
from thermoctl.plant.noise import Wander
from thermoctl.plant.tolerances import factor
from thermoctl.quantities import ZERO_CELSIUS_K, clamp
from thermoctl.ranges import require

STEFAN_BOLTZMANN = 5.670374419e-8
"""In W/(m2 K4)."""

LONGEST_STEP_S = 0.5
"""The heaters take two minutes; the midpoint rule is off by 1e-6 of that in a step."""


@dataclass(frozen=True, slots=True)
class LabParameters:
    """What a board is made of; the defaults are the published constants.

    Parameters
    ----------
    mass_kg, heat_j_per_kg_k : float
        Mass and specific heat of each heater with what is warmed along with it.
    film_w_per_m2_k : float
        Convection to the room, U.
    area_m2, between_m2 : float
        Surface of each heater that faces the room, A, and the other one, As.
    emissivity : float
        Of both, 0 to 1.
    first_w, second_w : float
        Power at 100 %: alpha1 is .01 W/%, alpha2 .0075 W/%.
    room_c : float
        Temperature of the room; also that of everything at the start.
    room_spread_k, room_s : float
        How far the room wanders, as a standard deviation, and over what time. A tenth of a kelvin
        leaves a board that rests as steady as one is that was recorded.
    sensor_lag_s : float
        Lag of the sensor behind its heater, which depends on how the two are glued together.

    Raises
    ------
    ValueError
        When any number lies outside its range; the message names it.
    """

    mass_kg: float = 0.004
    heat_j_per_kg_k: float = 500.0
    film_w_per_m2_k: float = 10.0
    area_m2: float = 1e-3
    between_m2: float = 2e-4
    emissivity: float = 0.9
    first_w: float = 1.0
    second_w: float = 0.75
    room_c: float = 23.0
    room_spread_k: float = 0.1
    room_s: float = 300.0
    sensor_lag_s: float = 9.0

    def __post_init__(self) -> None:
        require("mass_kg", self.mass_kg, 1e-4, 1.0)
        require("heat_j_per_kg_k", self.heat_j_per_kg_k, 100.0, 5000.0)
        require("film_w_per_m2_k", self.film_w_per_m2_k, 0.0, 500.0)
        require("area_m2", self.area_m2, 1e-5, 0.1)
        require("between_m2", self.between_m2, 0.0, 0.1)
        require("emissivity", self.emissivity, 0.0, 1.0)
        require("first_w", self.first_w, 0.0, 100.0)
        require("second_w", self.second_w, 0.0, 100.0)
        require("room_c", self.room_c, -40.0, 60.0)
        require("room_spread_k", self.room_spread_k, 0.0, 5.0)
        require("room_s", self.room_s, 1.0, 1e5)
        require("sensor_lag_s", self.sensor_lag_s, 0.1, 120.0)

    @property
    def heat_j_per_k(self) -> float:
        """Heat capacity of one heater."""
        return self.mass_kg * self.heat_j_per_kg_k


class LabHeat(NamedTuple):
    """Temperatures in degC; heat from both heaters and to the room, in J."""

    first_c: float
    second_c: float
    given_j: float = 0.0
    lost_j: float = 0.0


def start(parameters: LabParameters) -> LabHeat:
    """Return a board that is as warm as the room."""
    return LabHeat(parameters.room_c, parameters.room_c)


def passed_w(parameters: LabParameters, area_m2: float, warm_c: float, cold_c: float) -> float:
    """Return the heat that convection and radiation carry from one side to the other."""
    warm_k, cold_k = warm_c + ZERO_CELSIUS_K, cold_c + ZERO_CELSIUS_K
    radiated = parameters.emissivity * STEFAN_BOLTZMANN * (warm_k**4 - cold_k**4)
    return area_m2 * (parameters.film_w_per_m2_k * (warm_k - cold_k) + radiated)


def rates(p: LabParameters, heat: LabHeat, watts: tuple[float, float], room_c: float) -> LabHeat:
    """Return the rates of `heat` in a second, with `watts` in the two heaters."""
    first_w, second_w = watts
    across_w = passed_w(p, p.between_m2, heat.second_c, heat.first_c)
    from_first_w = passed_w(p, p.area_m2, heat.first_c, room_c)
    from_second_w = passed_w(p, p.area_m2, heat.second_c, room_c)
    return LabHeat(
        (first_w + across_w - from_first_w) / p.heat_j_per_k,
        (second_w - across_w - from_second_w) / p.heat_j_per_k,
        first_w + second_w,
        from_first_w + from_second_w,
    )


def step(
    p: LabParameters, heat: LabHeat, watts: tuple[float, float], room_c: float, step_s: float
) -> LabHeat:
    """Return `heat` after `step_s`, by the midpoint rule; no heat is lost in between."""
    midway = _moved(heat, rates(p, heat, watts, room_c), 0.5 * step_s)
    return _moved(heat, rates(p, midway, watts, room_c), step_s)


def _moved(heat: LabHeat, rate: LabHeat, step_s: float) -> LabHeat:
    return LabHeat(*(entry + step_s * each for entry, each in zip(heat, rate, strict=True)))


def lab_specimen(
    parameters: LabParameters, rng: Generator, spread: float = 0.1, lag_spread: float = 0.4
) -> LabParameters:
    """Return one board of many: film, power, room and lag vary.

    Parameters
    ----------
    parameters : LabParameters
        The board as it was ordered.
    rng : Generator
        Where the specimen comes from.
    spread, lag_spread : float
        Factors are log-normal; the standard deviation of their logarithms, and of that of the
        sensor's lag. Each is cut at two of them, so that a lag of 9 s becomes 4 to 20 s.

    Raises
    ------
    ValueError
        When a spread lies outside 0 to 0.5, or a factor takes a number out of its own range.
    """
    require("spread", spread, 0.0, 0.5)
    require("lag_spread", lag_spread, 0.0, 0.5)
    names = ("film_w_per_m2_k", "first_w", "second_w", "room_c")
    varied = {name: getattr(parameters, name) * factor(rng, spread) for name in names}
    lag_s = parameters.sensor_lag_s * factor(rng, lag_spread)
    return replace(parameters, **varied, sensor_lag_s=lag_s)


class TemperatureLab:
    """Two heaters, a room that wanders, and the sensor on the first heater.

    Parameters
    ----------
    parameters : LabParameters
        What it is made of.
    rng : Generator
        All randomness; equal generators give equal boards.
    """

    def __init__(self, parameters: LabParameters, rng: Generator) -> None:
        self.parameters = parameters
        self._room = Wander(rng, parameters.room_spread_k, parameters.room_s)
        self._heat = start(parameters)
        self._sensor_c = self._heat.first_c
        self._second = 0.0

    @property
    def heat(self) -> LabHeat:
        """Both temperatures, and what has crossed the boundary."""
        return self._heat

    @property
    def temperature_c(self) -> float:
        """Temperature of the first heater: what a perfect sensor shows."""
        return self._heat.first_c

    @property
    def sensor_c(self) -> float:
        """Temperature of the sensor on the first heater, without noise."""
        return self._sensor_c

    def second_heater(self, power: float) -> None:
        """Leave the second heater at `power` in [0, 1]; raises `ValueError` outside it."""
        require("power of the second heater", power, 0.0, 1.0)
        self._second = power

    def volts(self) -> float:
        """Return the voltage of the TMP36 that is the sensor."""
        return TMP36.volts(self._sensor_c)

    def advance(self, interval_s: float, drive: float) -> None:
        """Let `interval_s` pass with the first heater at `drive`.

        Parameters
        ----------
        interval_s : float
            Time to pass, at least 0 and finite; divided into equal steps of at most 0.5 s.
        drive : float
            Fraction of full power; what lies outside [0, 1] is limited, and NaN is 0.

        Raises
        ------
        ValueError
            When `interval_s` is negative or not finite.
        """
        if not 0.0 <= interval_s < math.inf:
            raise ValueError(f"interval_s must be at least 0 and finite, got {interval_s!r}")
        p = self.parameters
        watts = (clamp(drive, 0.0, 1.0) * p.first_w, self._second * p.second_w)
        steps = math.ceil(interval_s / LONGEST_STEP_S)
        for _ in range(steps):
            step_s = interval_s / steps
            before_c = self._heat.first_c
            room_c = p.room_c + self._room.advance(step_s)
            self._heat = step(p, self._heat, watts, room_c, step_s)
            self._sensor_c = followed(
                self._sensor_c, before_c, self._heat.first_c, step_s / p.sensor_lag_s
            )


def followed(sensor_c: float, before_c: float, after_c: float, lags: float) -> float:
    """Return where a first-order lag is after `lags` of its lags on a straight way."""
    slope_k = (after_c - before_c) / lags
    return after_c - slope_k + (sensor_c - before_c + slope_k) * math.exp(-lags)
