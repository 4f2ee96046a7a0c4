"""What an alarm means to who stands beside the tank, and where to look first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

ADVICE: Final[Mapping[str, str]] = {
    "board.fault": "the board reports a fault of its own: look at its output and its supply",
    "board.lost": "nothing talks to the board: look at cable, port and supply; one with a dead-man "
    "switches off by itself, any other may still be heating",
    "controller.failed": "the control law failed: the journal has the trace; start it anew",
    "cycle.failed": "the program failed in a cycle: the journal has the trace; start it anew",
    "estimator.failed": "learning failed: the journal has the trace; start it anew",
    "heater.no_response": "the water does not get warmer when it should: is the heater on, plugged "
    "in and whole, and does the sensor hang in this tank?",
    "heater.reversed": "the water gets colder when it should get warmer: is the output wired the "
    "wrong way round, or is it a cooler, or a sensor of another tank? Where heat takes more than "
    "half a minute to the sensor, first_heat_s has to be twice as long",
    "heater.stuck_on": "the water gets warmer although the heater is commanded off: pull its plug "
    "now; its relay or triac may be welded",
    "output.nan": "the control law asked for no number: the journal tells which one",
    "output.readback": "the output gives another power than was commanded: look at relay or triac; "
    "one that is late by its nature needs window_s in the table of its actuator",
    "output.refused": "the board did not take a power: look at cable, port and supply",
    "plant.driven": "something else moves the water: does the heater give power although it is "
    "off, or is the room warmer than the set point?",
    "sensor.disagree": "the two sensors tell different temperatures: does one hang in the air?",
    "sensor.first_lost": "the first of two sensors is gone: look at its cable and plug",
    "sensor.missing": "no reading arrives: look at the board, and at the cable to it",
    "sensor.open": "the sensor is torn off or unplugged: look at its cable and plug",
    "sensor.second_lost": "the second of two sensors is gone: look at its cable and plug",
    "sensor.short": "the wires of the sensor touch: look at its cable and plug for water",
    "sensor.spike": "readings jump as water cannot: look for a loose contact, or a dry element",
    "sensor.stale": "the readings are old or stand still: look at the board",
    "sensor.stuck": "the converter repeats itself: look at the board, and switch it off and on",
    "setpoint.unreachable": "the power there is will not do: ask for less, or close the lid",
    "trip.over_temperature": "too hot: find out why before you acknowledge",
    "trip.under_temperature": "too cold: find out why before you acknowledge",
}
"""By the code of the alarm; ``docs/faults.md`` says what the loop did about it."""


def advice_for(code: str) -> str:
    """Return one sentence about an alarm; empty where there is nothing to add."""
    return ADVICE.get(code, "")
