"""The tank near its set point as a linear plant, with probe and converter.

Nothing is modelled anew: the transition of the heat is differenced out of
`thermoctl.plant.thermal.step` itself, and probe, mains and ice are linear as they stand in
`docs/tank.md`. The state is [temperatures; mains, ice and turbulence; past water; water met and
sheath], advanced in the tank's own steps of half a second.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thermoctl.plant import thermal
from thermoctl.plant.acquisition import AcquisitionParameters
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters
from thermoctl.quantities import Array
from thermoctl.studies.compare.riccati import Linear

WATER, STILL, BATH = 1, 2, 4
"""Places of the state; it begins as `Temperatures` and `Heat` do: element, water, still, wall."""

KELVIN_PER_V = 100.0
_PROBE_K = 1e-3
_TURNS = 20


@dataclass(frozen=True, slots=True)
class Rest:
    """A tank that is held: its heat, and the power in [0, 1] that holds it."""

    heat: thermal.Heat
    power: float


def rest(parameters: TankParameters, target_c: float) -> Rest:
    """Return the state in which the water's mean temperature stays at `target_c`.

    Parameters
    ----------
    parameters : TankParameters
        The tank.
    target_c : float
        Mean temperature of the water in degC.

    Raises
    ------
    ValueError
        When there is no such state.
    """
    k, heat, power = thermal.conductances(parameters), thermal.start(parameters), 0.0
    n = len(_temperatures(k, heat)) + 1
    for _ in range(_TURNS):

        def drift(moved: Array, heat: thermal.Heat = heat, power: float = power) -> Array:
            at = _moved(k, heat, moved[:-1])
            heater_w = (power + moved[-1]) * parameters.element.rated_w
            off_k = thermal.temperatures(k, at).bulk_c - target_c
            return np.append(_rates(k, at, heater_w), off_k)

        residual = -drift(np.zeros(n))
        change: Array = np.linalg.inv(slope(drift, n)) @ residual
        heat, power = _moved(k, heat, change[:-1]), power + float(change[-1])
        if float(np.abs(change).max()) < 1e-9:
            return Rest(heat, power)
    raise ValueError(f"expected a state of rest at {target_c:g} degC, found none")


def linear_tank(
    parameters: TankParameters,
    acquisition: AcquisitionParameters,
    at: Rest,
    period_s: float = 1.0,
) -> Linear:
    """Return the tank about `at`, sampled every `period_s`.

    Its input is the power, its outputs are in K: measured is the mean of a burst, judged the mean
    temperature of the water.

    Parameters
    ----------
    parameters : TankParameters
        The tank.
    acquisition : AcquisitionParameters
        The converter; pickup, which a burst over whole mains periods adds up to nothing, counts
        only as what dithers the steps of the converter.
    at : Rest
        Where it is held.
    period_s : float
        Time between two samples.
    """
    steps = math.ceil(period_s / thermal.LONGEST_STEP_S)
    A, B, Q = over(steps, *_step(parameters, at, period_s / steps))
    share = parameters.vessel.still_share
    C, z = np.zeros((1, len(A))), np.zeros((1, len(A)))
    C[0, -1] = 1.0
    z[0, WATER], z[0, STILL] = 1.0 - share, share
    return Linear(A, B, Q, C, reading_variance(acquisition), z)


def over(steps: int, A: Array, B: Array, Q: Array) -> tuple[Array, Array, Array]:
    """Return transition, input and noise of equal steps with a constant input."""
    whole_A, whole_B, whole_Q = np.eye(len(A)), np.zeros_like(B), np.zeros_like(Q)
    for _ in range(steps):
        whole_A, whole_B, whole_Q = A @ whole_A, A @ whole_B + B, A @ whole_Q @ A.T + Q
    return whole_A, whole_B, whole_Q


def reading_variance(acquisition: AcquisitionParameters) -> float:
    """Return the variance of a burst's mean in K²: noise, and steps it dithers."""
    step_v = acquisition.reference_v / 2.0**acquisition.bits
    variance_v2 = acquisition.noise_v**2 + step_v**2 / 12.0
    return KELVIN_PER_V**2 * variance_v2 / acquisition.conversions


def _step(parameters: TankParameters, at: Rest, step_s: float) -> tuple[Array, Array, Array]:
    """Return transition, input and noise of one step of the tank."""
    k, supply, probe = thermal.conductances(parameters), parameters.supply, parameters.probe
    n = len(_temperatures(k, at.heat))

    def heat_after(moved: Array) -> Array:
        # moved: temperatures, power, unrest of the ice
        heater_w = (at.power + moved[n]) * parameters.element.rated_w
        heat = _moved(k, at.heat, moved[:n])
        return _temperatures(k, thermal.step(k, heat, heater_w, 1.0 + moved[n + 1], step_s))

    J = slope(heat_after, n + 2)
    late, part = divmod(probe.transport_s / step_s, 1.0)
    taps = int(late) + 1
    mains, ice, eddy, tap, met, sheath = n, n + 1, n + 2, n + 3, n + 3 + taps, n + 4 + taps
    size = sheath + 1
    # Columns: the state before, the power, and the kicks of mains, ice and turbulence.
    rows = np.zeros((size, size + 4))
    rows[:n, :n], rows[:n, size] = J[:, :n], J[:, n]
    rows[:n, mains], rows[:n, ice] = 2.0 * at.power * J[:, n], J[:, n + 1]  # power goes with V²
    wanders = (
        (mains, supply.voltage_spread, supply.voltage_s),
        (ice, supply.loss_spread, supply.loss_s),
        (eddy, probe.turbulence_k, probe.turbulence_s),
    )
    for place, (row, spread, correlation_s) in enumerate(wanders):
        decay = math.exp(-step_s / correlation_s)
        rows[row, row], rows[row, size + 1 + place] = decay, spread * math.sqrt(1.0 - decay**2)
    rows[tap, WATER] = 1.0
    for each in range(tap + 1, tap + taps):
        rows[each, each - 1] = 1.0
    past = [rows[WATER], *rows[tap : tap + taps]]
    rows[met] = (1.0 - part) * past[int(late)] + part * past[int(late) + 1] + rows[eddy]
    follow = -math.expm1(-step_s / probe.lag_s)
    rows[sheath] = 0.5 * follow * rows[met]
    rows[sheath, met] += 0.5 * follow
    rows[sheath, sheath] += 1.0 - follow
    kicks = rows[:, size + 1 :]
    return rows[:, :size], rows[:, size : size + 1], kicks @ kicks.T


def slope(function: Callable[[Array], Array], n: int) -> Array:
    """Return the Jacobian of `function` at 0 by central differences."""
    columns = []
    for place in range(n):
        moved = np.zeros(n)
        moved[place] = _PROBE_K
        columns.append((function(moved) - function(-moved)) / (2.0 * _PROBE_K))
    return np.array(columns).T


def _temperatures(k: thermal.Conductances, heat: thermal.Heat) -> Array:
    """Return the temperatures that move within an hour; without a bath, none of it."""
    every = thermal.temperatures(k, heat)
    return np.array(every[: BATH + 1] if heat.bath_kg > 0.0 else every[:BATH])


def _capacities(k: thermal.Conductances, heat: thermal.Heat) -> Array:
    """Return J/K of what has these temperatures."""
    water, bath = heat.water_kg * WATER_J_PER_KG_K, heat.bath_kg * WATER_J_PER_KG_K
    still = k.still_share * water
    every = (k.element_j_per_k, water - still, still, k.wall_j_per_k, bath)
    return np.array(every if heat.bath_kg > 0.0 else every[:BATH])


def _rates(k: thermal.Conductances, heat: thermal.Heat, heater_w: float) -> Array:
    """Return the rates of the temperatures in K/s.

    Water that goes takes its heat along, so the enthalpy of what stays falls without cooling it.
    """
    rate, n = thermal.rates(k, heat, heater_w), len(_temperatures(k, heat))
    gained_kg = k.still_share * rate.water_kg
    gained = np.array((0.0, rate.water_kg - gained_kg, gained_kg, 0.0, rate.bath_kg))[:n]
    carried = gained * WATER_J_PER_KG_K * _temperatures(k, heat)
    rates: Array = (np.array(rate[:n]) - carried) / _capacities(k, heat)
    return rates


def _moved(k: thermal.Conductances, heat: thermal.Heat, by_k: Array) -> thermal.Heat:
    """Return `heat` with its temperatures moved by `by_k`."""
    entries = np.array(heat[: len(by_k)]) + by_k * _capacities(k, heat)
    return thermal.Heat(*entries.tolist(), *heat[len(by_k) :])
