"""The tank near its set point as a linear plant, seen through probe and converter.

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

STATES = ("element_j", "water_j", "still_j", "wall_j", "bath_j")
"""Entries of the heat that move within an hour; masses are taken as they are."""

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
    k, heat = thermal.conductances(parameters), thermal.start(parameters)
    names = _states(heat)
    rated_w, capacity = parameters.element.rated_w, _capacities(k, heat)
    weight = _bulk_weight(k, len(names))
    power = 0.0
    for _ in range(_TURNS):

        def drift(moved: Array, heat: thermal.Heat = heat, power: float = power) -> Array:
            at = _moved(heat, names, moved[:-1] * capacity)
            rate = thermal.rates(k, at, (power + moved[-1]) * rated_w)
            off_k = weight @ _temperatures(at, names, capacity) - target_c
            return np.append(_entries(rate, names) / capacity, off_k)

        n = len(names) + 1
        change = np.linalg.solve(_slope(drift, n), -drift(np.zeros(n)))
        heat, power = _moved(heat, names, change[:-1] * capacity), power + float(change[-1])
        if float(np.abs(change).max()) < 1e-9:
            return Rest(heat, power)
    raise ValueError(f"expected a state of rest at {target_c:g} degC, found none")


def linear_tank(
    parameters: TankParameters,
    acquisition: AcquisitionParameters,
    at: Rest,
    period_s: float = 1.0,
) -> Linear:
    """Return the tank about `at`, sampled every `period_s`; input: power, outputs in K.

    Measured is the mean of a burst, judged the mean temperature of the water.

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
    A, B, Q = _step(parameters, at, period_s / steps)
    whole_A, whole_B, whole_Q = np.eye(len(A)), np.zeros_like(B), np.zeros_like(Q)
    for _ in range(steps):
        whole_A, whole_B, whole_Q = A @ whole_A, A @ whole_B + B, A @ whole_Q @ A.T + Q
    k = thermal.conductances(parameters)
    n = len(_states(at.heat))
    C, z = np.zeros((1, len(A))), np.zeros((1, len(A)))
    C[0, -1] = 1.0
    z[0, :n] = _bulk_weight(k, n)
    return Linear(whole_A, whole_B, whole_Q, C, _reading_variance(acquisition), z)


def _reading_variance(acquisition: AcquisitionParameters) -> float:
    """Return the variance of a burst's mean in K²: white noise, and steps that are dithered."""
    step_v = acquisition.reference_v / 2.0**acquisition.bits
    variance_v2 = acquisition.noise_v**2 + step_v**2 / 12.0
    return KELVIN_PER_V**2 * variance_v2 / acquisition.conversions


def _step(parameters: TankParameters, at: Rest, step_s: float) -> tuple[Array, Array, Array]:
    """Return transition, input and noise of one step of the tank."""
    k, names, supply = thermal.conductances(parameters), _states(at.heat), parameters.supply
    probe, capacity, n = parameters.probe, _capacities(k, at.heat), len(names)

    def heat_after(moved: Array) -> Array:
        # moved: temperatures, power, unrest of the ice
        heat = _moved(at.heat, names, moved[:n] * capacity)
        heater_w = (at.power + moved[n]) * parameters.element.rated_w
        after = thermal.step(k, heat, heater_w, 1.0 + moved[n + 1], step_s)
        return _entries(after, names) / capacity

    J = _slope(heat_after, n + 2)
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
    water = names.index("water_j")
    rows[tap, water] = 1.0
    for each in range(tap + 1, tap + taps):
        rows[each, each - 1] = 1.0
    past = [rows[water], *rows[tap : tap + taps]]
    rows[met] = (1.0 - part) * past[int(late)] + part * past[int(late) + 1] + rows[eddy]
    follow = -math.expm1(-step_s / probe.lag_s)
    rows[sheath] = 0.5 * follow * rows[met]
    rows[sheath, met] += 0.5 * follow
    rows[sheath, sheath] += 1.0 - follow
    kicks = rows[:, size + 1 :]
    return rows[:, :size], rows[:, size : size + 1], kicks @ kicks.T


def _slope(function: Callable[[Array], Array], n: int) -> Array:
    """Return the Jacobian of `function` at 0 by central differences."""
    columns = []
    for place in range(n):
        moved = np.zeros(n)
        moved[place] = _PROBE_K
        columns.append((function(moved) - function(-moved)) / (2.0 * _PROBE_K))
    return np.array(columns).T


def _states(heat: thermal.Heat) -> tuple[str, ...]:
    """Return the entries of `heat` that there are: no bath, no temperature of it."""
    return STATES if heat.bath_kg > 0.0 else STATES[:-1]


def _capacities(k: thermal.Conductances, heat: thermal.Heat) -> Array:
    """Return J/K of every entry of the state."""
    water = heat.water_kg * WATER_J_PER_KG_K
    still = k.still_share * water
    bath = heat.bath_kg * WATER_J_PER_KG_K
    every = np.array([k.element_j_per_k, water - still, still, k.wall_j_per_k, bath])
    return every[: len(_states(heat))]


def _bulk_weight(k: thermal.Conductances, n: int) -> Array:
    """Return how much each temperature counts in the mean of the water."""
    weight = np.zeros(n)
    weight[1:3] = 1.0 - k.still_share, k.still_share
    return weight


def _entries(heat: thermal.Heat, names: tuple[str, ...]) -> Array:
    return np.array([getattr(heat, name) for name in names])


def _temperatures(heat: thermal.Heat, names: tuple[str, ...], capacity: Array) -> Array:
    temperatures: Array = _entries(heat, names) / capacity
    return temperatures


def _moved(heat: thermal.Heat, names: tuple[str, ...], by_j: Array) -> thermal.Heat:
    """Return `heat` with its entries moved by `by_j`."""
    before = _entries(heat, names)
    return heat._replace(**dict(zip(names, (before + by_j).tolist(), strict=True)))
