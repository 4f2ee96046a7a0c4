"""One controller through one scenario on one plant: a trace of what came of it.

The regulator is the one of the daemon, with its supervisor around the law; sensor, converter and
power stage are those of the simulated board. There is no loop and no clock: a run is a function.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from thermoctl.model.sensor import Sensor
from thermoctl.plant.acquisition import Acquisition
from thermoctl.quantities import Array
from thermoctl.regulator import Plan, Regulator
from thermoctl.signals import Mode, RawSample, SetPoint, State, Step
from thermoctl.studies.compare.plants import PACE_S, Plant
from thermoctl.studies.compare.scenarios import BAND_K, SETPOINT, Happening, Scenario
from thermoctl.studies.compare.stand import stand_for

_BROKEN = ("controller.failed", "estimator.failed", "output.nan")


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """The judged stretch of a run; arrays have shape (T,).

    Parameters
    ----------
    t_s : ndarray
        Time from the beginning of the stretch.
    true_c, setpoint_c : ndarray
        Temperature that is judged, of water or heater, and what was asked for.
    power : ndarray
        What the hardware took, from this sample to the next.
    failure : str or None
        Why the regulator gave up at any time of the run, before the stretch included.
    band_k : float
        Settled means within this of the set point.
    """

    t_s: Array
    true_c: Array
    setpoint_c: Array
    power: Array
    failure: str | None = None
    band_k: float = BAND_K


def play(plan: Plan, plant: Plant, scenario: Scenario) -> Trace:
    """Return what `plan` makes of `scenario` on `plant`.

    Parameters
    ----------
    plan : Plan
        Laws and limits; it is started in auto at the set point of the scenarios.
    plant : Plant
        The plant, which is built anew from its seed.
    scenario : Scenario
        What happens.

    Raises
    ------
    Refused
        The plan's limits do not allow a set point that the scenario asks for.
    """
    period_s = plan.limits.period_s
    bench = _Bench(plan, plant)
    begin = 0 if scenario.from_cold else math.ceil(_settling_s(plant, scenario) / period_s)
    length_s = scenario.judged_s * (1.0 if scenario.steady else plant.pace)
    due = [(begin + round(each.at_s * plant.pace / period_s), each) for each in scenario.happenings]
    end = begin + round(length_s / period_s) + 1
    rows: Array = np.empty((end, 3))
    for sample in range(end):
        happening = [each for at, each in due if at == sample]
        rows[sample] = bench.live(sample * period_s, happening)
    t_s = period_s * np.arange(end - begin, dtype=np.float64)
    true_c, setpoint_c, power = rows[begin:].T
    return Trace(t_s, true_c, setpoint_c, power, bench.failure, plant.band_k)


def _settling_s(plant: Plant, scenario: Scenario) -> float:
    return (PACE_S + scenario.before_s) * plant.pace


class _Bench:
    """A regulator wired to a plant, a sample at a time."""

    def __init__(self, plan: Plan, plant: Plant) -> None:
        plant_rng, input_rng = plant.sources()
        self._stand = stand_for(plant, plant_rng)
        self._acquisition = Acquisition(plant.acquisition, input_rng)
        self._full_scale = float(plant.acquisition.full_scale)
        self._sensor = Sensor(self._stand.curve, plant.acquisition.reference_v)
        self._regulator = Regulator(replace(plan, setpoint_c=plant.held_c, mode=Mode.AUTO))
        self._period_s = plan.limits.period_s
        self._drive: float | None = None
        self.failure: str | None = None

    def live(self, t_s: float, happenings: list[Happening]) -> tuple[float, float, float]:
        """Return true temperature, set point and accepted power of the sample at `t_s`."""
        if self._drive is not None:
            self._stand.plant.advance(self._period_s, self._drive)
            self._acquisition.advance(self._period_s)
        for each in happenings:
            self._befall(each)
        true_c = self._stand.plant.temperature_c
        step = self._regulator.step(self._sensor.measure(self._sample(t_s), t_s))
        self._notice(step)
        law, steps = self._stand.law, self._stand.drive_steps
        self._drive = round(law.drive_for(step.command.power) * steps) / steps
        accepted = law.power_from(self._drive)
        self._regulator.applied(accepted)
        return true_c, step.setpoint_c, accepted

    def _befall(self, happening: Happening) -> None:
        if happening.name == SETPOINT:
            wanted_c = self._regulator.setpoint_c + (happening.amount or 0.0)
            self._regulator.request(SetPoint(wanted_c))
        else:
            self._stand.befall(happening.name, happening.amount)

    def _sample(self, t_s: float) -> RawSample | None:
        volts = self._stand.volts()
        if math.isnan(volts):
            return None
        return RawSample(t_s, float(self._acquisition.convert(volts)), self._full_scale)

    def _notice(self, step: Step) -> None:
        if self.failure is None:
            gave_up = step.state is State.LATCHED
            for alarm in step.alarms:
                if alarm.active and (alarm.code in _BROKEN or (gave_up and alarm.latched)):
                    self.failure = f"{alarm.code} at {step.t_s:.0f} s: {alarm.text}"
                    return
