"""What no controller can do better on a plant, computed for that very plant."""

from __future__ import annotations

import math

from thermoctl.plant import handling, lab, thermal
from thermoctl.plant.disturbances import DISTURBANCES
from thermoctl.plant.lab import LabHeat, LabParameters
from thermoctl.plant.parameters import REFERENCE_L, TankParameters
from thermoctl.studies.compare.labs import KnownLab, lab_rest, linear_lab
from thermoctl.studies.compare.linear import linear_tank, rest
from thermoctl.studies.compare.plants import Plant
from thermoctl.studies.compare.riccati import Linear, Spread, regulated
from thermoctl.studies.compare.scenarios import SETPOINT, Happening, Scenario
from thermoctl.studies.compare.swift import H, NoiselessTank, Steppable, swiftest

CHEAP = 1e-9
"""Price of the input that is as good as none, in K² per power squared."""

ROOM_SD = 3.0
"""An input can be given when so many of its standard deviations fit between 0 and 1."""

_PRICES = (1e-9, 1e6)
_HALVINGS = 40


def bounds(plant: Plant, scenario: Scenario, period_s: float = 1.0) -> dict[str, float | None]:
    """Return the bounds of a scenario, under the keys of its measures.

    ``settled_s`` is that of the fastest approach from rest, with steady mains and quiet ice, and
    ``deviation_k`` that of minimum variance. Two more are no measures: ``dip_k`` is how far the
    water falls whatever is done, and ``realisable_k`` the deviation of the best law whose power
    stays within its limits.

    Parameters
    ----------
    plant : Plant
        The plant, known to the last coefficient.
    scenario : Scenario
        What happens.
    period_s : float
        Time between two samples.
    """
    if scenario.steady:
        return _regulation(plant, period_s)
    parameters = plant.parameters
    if isinstance(parameters, LabParameters):
        begin = _begin_lab(parameters, plant.held_c, scenario)
        return _approach(KnownLab(parameters, period_s), begin, plant, scenario)
    heat = _begin(parameters, plant.held_c, scenario)
    return _approach(NoiselessTank.of(parameters, period_s), heat, plant, scenario)


def _approach(
    known: Steppable[H], begin: H | None, plant: Plant, scenario: Scenario
) -> dict[str, float | None]:
    """Return the bounds of the way from `begin`; None: there are none."""
    if begin is None:
        return {}
    stepped_k = sum(each.amount or 0.0 for each in scenario.happenings if each.name == SETPOINT)
    target_c = plant.held_c + stepped_k
    way = swiftest(known, begin, target_c, plant.band_k, plant.band_k)
    if way is None:
        return {"settled_s": None}
    found: dict[str, float | None] = {"settled_s": way.settled_s}
    if not stepped_k and not scenario.from_cold:
        found["dip_k"] = target_c - way.lowest_c
    return found


def _begin(tank: TankParameters, held_c: float, scenario: Scenario) -> thermal.Heat | None:
    """Return where a tank is when it happens; None: no bound."""
    if scenario.from_cold:
        return thermal.start(tank)
    if len(scenario.happenings) != 1:
        return None
    (happening,) = scenario.happenings
    held, amount = rest(tank, held_c).heat, _amount(tank, happening)
    match happening.name:
        case name if name == SETPOINT:
            return held
        case "cold-water":
            return handling.pour(held, tank.vessel, amount, tank.pour_c)
        case "ice":
            return handling.throw_ice(held, tank.vessel, amount)
        case _:
            return None


def _begin_lab(parameters: LabParameters, held_c: float, scenario: Scenario) -> LabHeat | None:
    """Return where a lab is when it happens; None: no bound.

    The second heater acts where the power does, so whoever knew it would not let it be seen.
    """
    if scenario.from_cold:
        return lab.start(parameters)
    if [each.name for each in scenario.happenings] == [SETPOINT]:
        return lab_rest(parameters, held_c).heat
    return None


def _amount(tank: TankParameters, happening: Happening) -> float:
    """Return the amount of a happening on a tank of this size."""
    if happening.amount is not None:
        return happening.amount
    usual = DISTURBANCES[happening.name]
    return usual.default * float((tank.vessel.volume_l / REFERENCE_L) ** usual.growth)


def _regulation(plant: Plant, period_s: float) -> dict[str, float | None]:
    """Return the deviations of minimum variance and of an input that can be given."""
    linear, power = _linear(plant, period_s)
    room = min(power, 1.0 - power) / ROOM_SD
    return {
        "deviation_k": regulated(linear, CHEAP).judged,
        "realisable_k": realisable(linear, room).judged,
    }


def _linear(plant: Plant, period_s: float) -> tuple[Linear, float]:
    """Return the plant about its set point, and the power that holds it there."""
    parameters = plant.parameters
    if isinstance(parameters, LabParameters):
        at = lab_rest(parameters, plant.held_c)
        return linear_lab(parameters, plant.acquisition, at, period_s), at.power
    held = rest(parameters, plant.held_c)
    return linear_tank(parameters, plant.acquisition, held, period_s), held.power


def realisable(linear: Linear, room: float) -> Spread:
    """Return the least deviation with an input that strays by `room` at most.

    Raises
    ------
    ValueError
        When no price of the input makes it so quiet.
    """
    cheap, dear = (math.log(price) for price in _PRICES)
    quiet = regulated(linear, math.exp(dear))
    if quiet.input > room:
        raise ValueError(f"expected an input as quiet as {room:g}, the quietest is {quiet.input:g}")
    for _ in range(_HALVINGS):
        middle = 0.5 * (cheap + dear)
        spread = regulated(linear, math.exp(middle))
        if spread.input > room:
            cheap = middle
        else:
            dear, quiet = middle, spread
    return quiet
