"""The lab known to the last coefficient: at rest, on its way, as a linear plant.

The state of the linear plant is [first heater, second heater, room, sensor], advanced in the lab's
own steps of half a second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.plant import lab
from thermoctl.plant.acquisition import AcquisitionParameters
from thermoctl.plant.lab import LabHeat, LabParameters
from thermoctl.quantities import Array
from thermoctl.studies.compare.linear import over, reading_variance, slope
from thermoctl.studies.compare.riccati import Linear

FIRST, SECOND, ROOM, SENSOR = range(4)

_HALVINGS = 60


@dataclass(frozen=True, slots=True)
class KnownLab:
    """A lab in a steady room, its second heater off, stepped as the simulated one is.

    Parameters
    ----------
    parameters : LabParameters
        Its coefficients.
    period_s : float
        Power is constant from one sample to the next, this long.
    """

    parameters: LabParameters
    period_s: float = 1.0

    def advance(self, heat: LabHeat, power: float) -> LabHeat:
        """Return the heat one period later; `power` is a fraction in [0, 1]."""
        p = self.parameters
        steps = math.ceil(self.period_s / lab.LONGEST_STEP_S)
        for _ in range(steps):
            heat = lab.step(p, heat, (power * p.first_w, 0.0), p.room_c, self.period_s / steps)
        return heat

    def bulk_c(self, heat: LabHeat) -> float:
        """Return the temperature that is judged, that of the first heater."""
        return heat.first_c


@dataclass(frozen=True, slots=True)
class LabAtRest:
    """A lab whose first heater is held: its heat, and the power that holds it."""

    heat: LabHeat
    power: float


def lab_rest(parameters: LabParameters, target_c: float) -> LabAtRest:
    """Return the state in which the first heater stays at `target_c`, the other off.

    Parameters
    ----------
    parameters : LabParameters
        The lab.
    target_c : float
        Temperature of the first heater in degC.

    Raises
    ------
    ValueError
        When no power from 0 to 1 keeps it there.
    """
    cold_c, warm_c = sorted((parameters.room_c, target_c))
    for _ in range(_HALVINGS):
        second_c = 0.5 * (cold_c + warm_c)
        heat = LabHeat(target_c, second_c)
        rate = lab.rates(parameters, heat, (0.0, 0.0), parameters.room_c)
        cold_c, warm_c = (second_c, warm_c) if rate.second_c > 0.0 else (cold_c, second_c)
    power = -rate.first_c * parameters.heat_j_per_k / parameters.first_w
    if not 0.0 <= power <= 1.0:
        raise ValueError(f"expected a power from 0 to 1 that holds {target_c:g} degC, got {power}")
    return LabAtRest(heat, power)


def lag_s(parameters: LabParameters, target_c: float) -> float:
    """Return the time constant of the first heater about `target_c`, alone."""
    heat = lab_rest(parameters, target_c).heat

    def rate(off_k: float) -> float:
        moved = heat._replace(first_c=target_c + off_k)
        return lab.rates(parameters, moved, (0.0, 0.0), parameters.room_c).first_c

    return 2.0 / (rate(-1.0) - rate(1.0))


def linear_lab(
    parameters: LabParameters,
    acquisition: AcquisitionParameters,
    at: LabAtRest,
    period_s: float = 1.0,
) -> Linear:
    """Return the lab about `at`, sampled every `period_s`.

    Its input is the power, its outputs are in K: measured is the mean of a burst, judged the first
    heater.

    Parameters
    ----------
    parameters : LabParameters
        The lab.
    acquisition : AcquisitionParameters
        The converter.
    at : LabAtRest
        Where it is held.
    period_s : float
        Time between two samples.
    """
    steps = math.ceil(period_s / lab.LONGEST_STEP_S)
    A, B, Q = over(steps, *_step(parameters, at, period_s / steps))
    C, z = np.zeros((1, len(A))), np.zeros((1, len(A)))
    C[0, SENSOR], z[0, FIRST] = 1.0, 1.0
    return Linear(A, B, Q, C, reading_variance(acquisition), z)


def _step(p: LabParameters, at: LabAtRest, step_s: float) -> tuple[Array, Array, Array]:
    """Return transition, input and noise of one step of the lab."""

    def after(moved: Array) -> Array:
        # moved: both heaters, the room as it is during the step, the power
        heat = LabHeat(at.heat.first_c + moved[FIRST], at.heat.second_c + moved[SECOND])
        watts = ((at.power + moved[3]) * p.first_w, 0.0)
        return np.array(lab.step(p, heat, watts, p.room_c + moved[ROOM], step_s)[:2])

    J = slope(after, 4)
    decay = math.exp(-step_s / p.room_s)
    # Columns: the state before, the power, and the kick of the room, which comes before the step.
    rows = np.zeros((4, 6))
    rows[ROOM, ROOM], rows[ROOM, 5] = decay, p.room_spread_k * math.sqrt(1.0 - decay**2)
    rows[:ROOM, :ROOM], rows[:ROOM, 4] = J[:, :ROOM], J[:, 3]
    rows[:ROOM] += np.outer(J[:, ROOM], rows[ROOM])
    lags = step_s / p.sensor_lag_s
    rows[SENSOR] = lab.followed(0.0, 0.0, 1.0, lags) * rows[FIRST]
    rows[SENSOR, FIRST] += lab.followed(0.0, 1.0, 0.0, lags)
    rows[SENSOR, SENSOR] += lab.followed(1.0, 0.0, 0.0, lags)
    kick = rows[:, 5:]
    return rows[:, :4], rows[:, 4:5], kick @ kick.T
