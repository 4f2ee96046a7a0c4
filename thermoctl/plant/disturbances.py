"""Disturbances by name: what can befall a tank, its unit, its default."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from thermoctl.plant.parameters import REFERENCE_L
from thermoctl.plant.power_stage import Output
from thermoctl.plant.probe import Wiring
from thermoctl.plant.tank import Tank
from thermoctl.ranges import require

SAG_S = 60.0
DRAUGHT_S = 300.0
FOREVER_S = 1e6


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One thing that can befall a tank.

    Parameters
    ----------
    text : str
        What it is, in a few words.
    unit : str
        Unit of the amount; empty where the amount means nothing.
    default, low, high : float
        Amount when none is given, and its bounds.
    apply : callable
        Does it to a tank and returns a sentence that says what happened.
    growth : float
        `default` and `high` are those of the 8 l rig and grow with this power of the volume.
    """

    text: str
    unit: str
    default: float
    low: float
    high: float
    apply: Callable[[Tank, float], str]
    growth: float = 0.0


def disturb(tank: Tank, name: str, amount: float | None = None) -> str:
    """Start the disturbance `name` and return a sentence that says what happened.

    Parameters
    ----------
    tank : Tank
        What it befalls.
    name : str
        A key of `DISTURBANCES`.
    amount : float or None
        In the unit listed there; None for the default listed there.

    Raises
    ------
    ValueError
        When the name is unknown, the amount is out of range, or the tank cannot do it.
    """
    disturbance = DISTURBANCES.get(name)
    if disturbance is None:
        raise ValueError(f"disturbance must be one of {', '.join(DISTURBANCES)}, got {name!r}")
    scale = float((tank.parameters.vessel.volume_l / REFERENCE_L) ** disturbance.growth)
    quantity = disturbance.default * scale if amount is None else amount
    require(f"amount of {name}", quantity, disturbance.low, disturbance.high * scale)
    return disturbance.apply(tank, quantity)


def _pour(tank: Tank, litres: float) -> str:
    drained_kg = tank.heat.drained_kg
    tank.pour(litres, tank.parameters.pour_c)
    overflow_kg = tank.heat.drained_kg - drained_kg
    spilt = f"; {overflow_kg:.2f} kg ran over" if overflow_kg > 0.0 else ""
    return f"{litres:.3g} l of {tank.parameters.pour_c:.3g} degC water poured in{spilt}"


def _throw_ice(tank: Tank, ice_kg: float) -> str:
    tank.throw_ice(ice_kg)
    return f"{ice_kg:.3g} kg of ice thrown into the water"


def _refill_bath(tank: Tank, ice_kg: float) -> str:
    tank.refill_bath(ice_kg)
    return f"{ice_kg:.3g} kg of ice added to the bath, {tank.heat.bath_ice_kg:.3g} kg in it now"


def _drain(tank: Tank, fraction: float) -> str:
    tank.drain(fraction)
    return f"{fraction:.0%} of the water gone, {tank.heat.water_kg:.3g} kg left"


def _toggle_stirrer(tank: Tank, _: float) -> str:
    tank.stir(not tank.stirred)
    return "stirrer started" if tank.stirred else "stirrer stopped"


def _sag(tank: Tank, depth: float) -> str:
    tank.stage.sag(depth, SAG_S)
    return f"mains {depth:.0%} low for {SAG_S:.0f} s"


def _draught(tank: Tank, factor: float) -> str:
    tank.draught(factor, DRAUGHT_S)
    return f"draught: the air takes {factor:.3g} times as much for {DRAUGHT_S:.0f} s"


def _spike(tank: Tank, spike_k: float) -> str:
    tank.probe.spike(spike_k)
    return f"next sample {spike_k:+.3g} K off"


def _drift(tank: Tank, rate_k_per_min: float) -> str:
    """Let the second sensor drift, or the only one."""
    which, probe = ("sensor", tank.probe) if tank.second is None else ("second sensor", tank.second)
    probe.drift(rate_k_per_min / 60.0)
    return f"the {which} drifts by {rate_k_per_min:+.3g} K a minute from now on"


def _rewiring(wiring: Wiring) -> Callable[[Tank, float], str]:
    """Return a disturbance that leaves the sensor `wiring` for some seconds."""

    def apply(tank: Tank, duration_s: float) -> str:
        tank.probe.rewire(wiring, duration_s)
        return f"sensor {wiring.value} for {duration_s:.3g} s"

    return apply


def _failing(output: Output) -> Callable[[Tank, float], str]:
    """Return a disturbance that lets the heater do something else for some seconds."""

    def apply(tank: Tank, duration_s: float) -> str:
        tank.stage.fail(output, duration_s)
        return f"heater {output.value} for {duration_s:.3g} s"

    return apply


def _sensor_out(tank: Tank, duration_s: float) -> str:
    room_c = tank.parameters.room.temperature_c
    tank.probe.leave(room_c, duration_s)
    return f"sensor out of the tank, in air of {room_c:.3g} degC, for {duration_s:.3g} s"


def _sensor_stuck(tank: Tank, duration_s: float) -> str:
    tank.probe.leave(math.nan, duration_s)
    return f"sensor stands still for {duration_s:.3g} s"


DISTURBANCES: Mapping[str, Disturbance] = {
    "cold-water": Disturbance("pour cold water", "l", 1.0, 0.0, 8.0, _pour, growth=1.0),
    "ice": Disturbance("throw ice in", "kg", 0.3, 0.0, 4.0, _throw_ice, growth=1.0),
    "bath-ice": Disturbance("refill the bath", "kg", 5.0, 0.0, 20.0, _refill_bath, growth=2 / 3),
    "half-gone": Disturbance("lose water", "fraction", 0.5, 0.0, 0.9, _drain),
    "stirrer": Disturbance("stop or start the stirrer", "", 0.0, 0.0, 1.0, _toggle_stirrer),
    "sag": Disturbance("mains sag for a minute", "fraction", 0.15, 0.0, 1.0, _sag),
    "draught": Disturbance("draught for five minutes", "times", 4.0, 0.0, 20.0, _draught),
    "spike": Disturbance("one bad sample", "K", 50.0, -300.0, 300.0, _spike),
    "drift": Disturbance("the second sensor drifts", "K/min", 0.1, -10.0, 10.0, _drift),
    "dropout": Disturbance("no samples", "s", 15.0, 0.0, 1e6, _rewiring(Wiring.MISSING)),
    "open": Disturbance("broken wire", "s", 15.0, 0.0, 1e6, _rewiring(Wiring.OPEN)),
    "short": Disturbance("shorted wire", "s", 15.0, 0.0, 1e6, _rewiring(Wiring.SHORT)),
    "sensor-out": Disturbance("sensor falls out", "s", FOREVER_S, 0.0, FOREVER_S, _sensor_out),
    "sensor-stuck": Disturbance(
        "reading stands still", "s", FOREVER_S, 0.0, FOREVER_S, _sensor_stuck
    ),
    "element-dead": Disturbance(
        "heater gives nothing", "s", FOREVER_S, 0.0, FOREVER_S, _failing(Output.DEAD)
    ),
    "inverted": Disturbance(
        "power cools", "s", FOREVER_S, 0.0, FOREVER_S, _failing(Output.INVERTED)
    ),
    "stuck-on": Disturbance(
        "heater always on", "s", FOREVER_S, 0.0, FOREVER_S, _failing(Output.STUCK_ON)
    ),
}
"""Every disturbance by name."""
