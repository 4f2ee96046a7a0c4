"""What no controller can do better on a plant, computed for that very plant."""

from __future__ import annotations

import math

from thermoctl.plant import handling, thermal
from thermoctl.plant.disturbances import DISTURBANCES
from thermoctl.plant.parameters import REFERENCE_L, TankParameters
from thermoctl.studies.compare.linear import linear_tank, rest
from thermoctl.studies.compare.plants import Plant
from thermoctl.studies.compare.riccati import Linear, Spread, regulated
from thermoctl.studies.compare.scenarios import HELD_C, SETPOINT, Happening, Scenario
from thermoctl.studies.compare.swift import Known, swiftest

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
    begin = _begin(plant, scenario)
    if begin is None:
        return {}
    heat, target_c = begin
    way = swiftest(Known.of(plant.parameters, period_s), heat, target_c)
    if way is None:
        return {"settled_s": None}
    found: dict[str, float | None] = {"settled_s": way.settled_s}
    if target_c == HELD_C and not scenario.from_cold:
        found["dip_k"] = target_c - way.lowest_c
    return found


def _begin(plant: Plant, scenario: Scenario) -> tuple[thermal.Heat, float] | None:
    """Return where the plant is when it happens, and where it is to be; None: no bound."""
    tank = plant.parameters
    if scenario.from_cold:
        return thermal.start(tank), HELD_C
    if len(scenario.happenings) != 1:
        return None
    (happening,) = scenario.happenings
    held, amount = rest(tank, HELD_C).heat, _amount(tank, happening)
    match happening.name:
        case name if name == SETPOINT:
            return held, HELD_C + amount
        case "cold-water":
            return handling.pour(held, tank.vessel, amount, tank.pour_c), HELD_C
        case "ice":
            return handling.throw_ice(held, tank.vessel, amount), HELD_C
        case _:
            return None


def _amount(tank: TankParameters, happening: Happening) -> float:
    """Return the amount of a happening on a tank of this size."""
    if happening.amount is not None:
        return happening.amount
    usual = DISTURBANCES[happening.name]
    return usual.default * float((tank.vessel.volume_l / REFERENCE_L) ** usual.growth)


def _regulation(plant: Plant, period_s: float) -> dict[str, float | None]:
    """Return the deviations of minimum variance and of an input that can be given."""
    held = rest(plant.parameters, HELD_C)
    linear = linear_tank(plant.parameters, plant.acquisition, held, period_s)
    room = min(held.power, 1.0 - held.power) / ROOM_SD
    return {
        "deviation_k": regulated(linear, CHEAP).judged,
        "realisable_k": realisable(linear, room).judged,
    }


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
