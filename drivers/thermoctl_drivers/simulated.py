"""A board wired to a simulated tank, for trials, tests and teaching.

The tank's time is the clock's: every `read` and `write` first lets the tank catch up. On a
simulated clock an hour takes a fraction of a second; on a real one the tank lives in real time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from thermoctl.errors import BoardConfigError, LinkError, Refused
from thermoctl.model.sensor import LM335
from thermoctl.plant.acquisition import Acquisition, AcquisitionParameters
from thermoctl.plant.disturbances import disturb
from thermoctl.plant.parameters import Cooler, TankParameters
from thermoctl.plant.power_stage import STAGES
from thermoctl.plant.tank import Tank
from thermoctl.plant.tolerances import specimen
from thermoctl.ports import Capabilities, Clock, Health, Identity, Link
from thermoctl.quantities import clamp
from thermoctl.signals import RawSample
from thermoctl_drivers.outputs import commanded

INPUT = "temperature"
SECOND_INPUT = "temperature2"
ELEMENT = "element"
OUTPUT = "heater"
COOLER = "cooler"
MAINS_PERIODS_A_BURST = 2


class SimulatedSettings(BaseModel):
    """Table ``[boards.NAME]`` of ``kind = "simulated"``: tank and converters."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kind: Literal["simulated"] = "simulated"
    volume_l: float = Field(8.0, ge=0.5, le=200.0, description="Water in the tank, in l.")
    heater_w: float = Field(1500.0, ge=50.0, le=5000.0, description="Rated power, in W.")
    ambient_c: float = Field(22.0, ge=0.0, le=50.0, description="The room, in degC.")
    initial_c: float = Field(25.0, ge=1.0, le=95.0, description="The water at the start, in degC.")
    ice_kg: float | None = Field(
        None,
        ge=0.0,
        le=500.0,
        description="Ice around the tank, in kg; 0: it stands in air; left out: as the rig has.",
    )
    element_lag_s: float = Field(13.5, ge=2.0, le=120.0, description="Lag of the heater, in s.")
    cooler_w: float = Field(
        0.0, ge=0.0, le=5000.0, description="Heat an output `cooler` takes out, in W; 0: none."
    )
    cooler_lag_s: float = Field(20.0, ge=2.0, le=120.0, description="Lag of the cooler, in s.")
    element_sensor: bool = Field(
        False, description="Whether an LM335 on the heater is there, as input `element`."
    )
    transport_s: float | None = Field(
        None,
        ge=0.0,
        le=30.0,
        description="Time from heater to sensor, in s; left out: by the size of the tank.",
    )
    sensor_lag_s: float = Field(6.0, ge=0.5, le=120.0, description="Lag of the sensor, in s.")
    second_sensor: bool = Field(
        False, description="Whether a second LM335 is in the water, as input `temperature2`."
    )
    second_lag_s: float = Field(6.0, ge=0.5, le=120.0, description="Its lag, in s.")
    second_gain_error: float = Field(
        0.0, ge=-0.05, le=0.05, description="Its relative error; 0.001 is 0.3 K in warm water."
    )
    tolerances: float = Field(
        0.0, ge=0.0, le=0.3, description="Spread of what varies between specimens; 0.1 is 10 %."
    )
    bits: int = Field(10, ge=8, le=24, description="Resolution of the A/D converter, in bits.")
    reference_v: float = Field(5.0, ge=3.0, le=10.0, description="A/D full scale, in V.")
    conversions: int = Field(
        32,
        ge=1,
        le=1000,
        description="Conversions in a burst, spread over two mains periods; fewer than 4 spoil "
        "regulation and learning.",
    )
    noise_mv: float = Field(1.0, ge=0.0, le=100.0, description="Noise per conversion, rms in mV.")
    pickup_mv: float = Field(3.0, ge=0.0, le=100.0, description="Mains pickup, amplitude in mV.")
    mains_hz: float = Field(50.0, ge=45.0, le=65.0, description="Mains frequency, in Hz.")
    power_stage: Literal["square", "phase-angle", "burst", "linear"] = Field(
        "square", description="How the heater's power follows from the drive."
    )
    dac_bits: int = Field(12, ge=6, le=24, description="Resolution of the output, in bits.")
    dead_man_s: float = Field(
        2.5, ge=0.1, le=60.0, description="Heater off so long after the last write, in s."
    )
    seed: int = Field(1, ge=0, description="Seed of all randomness; equal seeds, equal runs.")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the channels that are read."""
        second = (SECOND_INPUT,) if self.second_sensor else ()
        return (INPUT, *second, *((ELEMENT,) if self.element_sensor else ()))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the channels that may be written."""
        return (OUTPUT, COOLER) if self.cooler_w > 0.0 else (OUTPUT,)


class SimulatedBoard:
    """Bench test: a simulated tank with its sensor, heater and, if asked for, cooler.

    The input ``temperature`` is the sum of a burst of conversions of an LM335, and so is
    ``temperature2`` and ``element``, where there is a second sensor and one on the heater. The
    output ``heater`` is the drive of the power stage, in [0, 1]; where there is a cooler,
    ``cooler`` is the share of its heat.

    Parameters
    ----------
    settings : SimulatedSettings
        The tank and the converters.
    link : Link or None
        Not used; there is no wire.
    clock : Clock
        The time the tank follows.

    Raises
    ------
    BoardConfigError
        When the settings do not make a tank together.
    """

    Settings: ClassVar[type[SimulatedSettings]] = SimulatedSettings
    capabilities: Capabilities = Capabilities(dead_man=True)

    def __init__(self, settings: SimulatedSettings, link: Link | None, clock: Clock) -> None:
        del link  # every driver is built alike; this one has nothing to talk to
        tank_rng, _, input_rng, element_rng, second_rng = _generators(settings)
        try:
            parameters = tank_parameters(settings)
            acquisition = _acquisition_parameters(settings)
        except ValueError as error:
            raise BoardConfigError(str(error)) from error
        self._settings, self._clock = settings, clock
        self._tank = Tank(parameters, tank_rng, STAGES[settings.power_stage])
        self._acquisition = Acquisition(acquisition, input_rng)
        self._element = Acquisition(acquisition, element_rng) if settings.element_sensor else None
        self._second = Acquisition(acquisition, second_rng) if settings.second_sensor else None
        inputs = (self._acquisition, self._element, self._second)
        self._inputs = tuple(each for each in inputs if each is not None)
        self._full_scale = float(acquisition.full_scale)
        self._drive_steps = 2**settings.dac_bits - 1
        self._is_open = False
        self._now_s = math.nan
        self._drives = dict.fromkeys(settings.outputs, 0.0)
        self._armed_until_s = -math.inf
        self._sequence = 0
        self._last_good_s: float | None = None
        self._missing = False
        self._counters = {"reads": 0, "writes": 0, "no_sample": 0, "dead_man": 0}

    def open(self, deadline_s: float) -> Identity:
        """Switch everything off and identify the board; at once, whatever `deadline_s`."""
        del deadline_s
        now_s = self._clock.now_s()
        if math.isnan(self._now_s):
            self._now_s = now_s  # the tank's life begins here
        self._is_open = True
        self._catch_up()
        self._switch_off()
        size = f"{self._settings.volume_l:g} l, {self._settings.heater_w:g} W"
        return Identity(kind="simulated", name=size, version=str(self._settings.seed))

    def read(self, deadline_s: float) -> Mapping[str, RawSample]:
        """Convert once, at the clock's time; an input without a sensor is left out.

        Raises
        ------
        LinkError
            When the board is not open.
        """
        del deadline_s  # answers at once
        self._catch_up()
        self._counters["reads"] += 1
        self._sequence += 1
        samples = {}
        volts = self._tank.probe.volts()
        self._missing = math.isnan(volts)
        if self._missing:
            self._counters["no_sample"] += 1
        else:
            self._last_good_s = self._now_s
            samples[INPUT] = self._sample(self._acquisition, volts)
        if self._second is not None and self._tank.second is not None:
            second_v = self._tank.second.volts()
            if not math.isnan(second_v):
                samples[SECOND_INPUT] = self._sample(self._second, second_v)
        if self._element is not None:
            element_v = LM335.volts(self._tank.temperatures.element_c)
            samples[ELEMENT] = self._sample(self._element, element_v)
        return samples

    def _sample(self, acquisition: Acquisition, volts: float) -> RawSample:
        counts = float(acquisition.convert(volts))
        return RawSample(self._now_s, counts, self._full_scale, self._sequence)

    def write(
        self, outputs: Mapping[str, float], valid_for_s: float, deadline_s: float
    ) -> Mapping[str, float]:
        """Set the drives, re-arm the dead-man, and return what the D/A converters took.

        Parameters
        ----------
        outputs : mapping
            Drives in [0, 1] of ``heater`` and ``cooler``; what lies outside is limited, and NaN
            is 0.
        valid_for_s : float
            Everything goes off after this or after ``dead_man_s``, whichever comes first.
        deadline_s : float
            Not used; the board takes the drive at once.

        Raises
        ------
        LinkError
            When the board is not open.
        BoardConfigError
            When there is no such output; nothing is changed.
        FaultError
            When a drive or the time is infinite or no number; everything is off then.
        """
        del deadline_s
        for name in outputs:
            if name not in self._drives:
                known = " or ".join(repr(each) for each in self._drives)
                raise BoardConfigError(f"output must be {known}, got {name!r}")
        self._catch_up()
        self._counters["writes"] += 1
        before, steps = dict(self._drives), self._drive_steps
        if outputs:
            self._switch_off()  # and so it stays when what is asked is no command
        for name, drive in outputs.items():
            wished, held_s = commanded(name, drive, valid_for_s, self._settings.dead_man_s)
            before[name] = round(wished * steps) / steps
            self._armed_until_s = self._now_s + held_s
        self._drives = before
        return dict(before)

    def _switch_off(self) -> None:
        self._drives = dict.fromkeys(self._drives, 0.0)

    def health(self) -> Health:
        """Return counters; ``degraded`` without a sensor, ``down`` when closed."""
        if not self._is_open:
            return Health("down", dict(self._counters), self._last_good_s, "board is not open")
        status, error = ("degraded", "no sample from the sensor") if self._missing else ("ok", None)
        return Health(status, dict(self._counters), self._last_good_s, error)

    def close(self) -> None:
        """Switch everything off and let go; the tank lives on and may be opened again."""
        if self._is_open:
            self._catch_up()
        self._switch_off()
        self._is_open = False

    def truth(self) -> Mapping[str, float]:
        """Return what no sensor sees, as of the last read or write."""
        return self._tank.truth()

    def disturb(self, name: str, amount: float | None = None) -> str:
        """Start the disturbance `name`, one of `DISTURBANCES` of the plant.

        Raises
        ------
        Refused
            When there is no such disturbance, or the tank cannot do it; nothing has changed.
        """
        try:
            return disturb(self._tank, name, amount)
        except ValueError as error:
            raise Refused(str(error)) from error

    def _catch_up(self) -> None:
        """Let the tank live until now, with all off once the dead-man has run out."""
        if not self._is_open:
            raise LinkError("board must be opened first, it is closed")
        now_s = self._clock.now_s()
        interval_s = now_s - self._now_s
        if interval_s <= 0.0:
            return
        driven_s = clamp(self._armed_until_s - self._now_s, 0.0, interval_s)
        self._tank.advance(driven_s, self._drives[OUTPUT], self._drives.get(COOLER, 0.0))
        if driven_s < interval_s:
            self._counters["dead_man"] += any(self._drives.values())
            self._switch_off()
            self._tank.advance(interval_s - driven_s, 0.0)
        for each in self._inputs:
            each.advance(interval_s)
        self._now_s = now_s


def _generators(settings: SimulatedSettings) -> list[np.random.Generator]:
    """Return those of the tank, of its specimen, and of the three inputs."""
    return np.random.default_rng(settings.seed).spawn(5)


def tank_parameters(settings: SimulatedSettings) -> TankParameters:
    """Return the tank that was built; raise ValueError where its parts do not fit."""
    return specimen(_ordered(settings), _generators(settings)[1], settings.tolerances)


def _ordered(settings: SimulatedSettings) -> TankParameters:
    """Return the tank that was ordered."""
    scaled = TankParameters.scaled(
        settings.volume_l,
        settings.heater_w,
        ambient_c=settings.ambient_c,
        initial_c=settings.initial_c,
        ice_kg=settings.ice_kg,
    )
    transport_s = settings.transport_s
    probe = replace(
        scaled.probe,
        lag_s=settings.sensor_lag_s,
        transport_s=scaled.probe.transport_s if transport_s is None else transport_s,
    )
    second = replace(probe, lag_s=settings.second_lag_s, gain_error=settings.second_gain_error)
    return replace(
        scaled,
        element=replace(scaled.element, lag_s=settings.element_lag_s),
        cooler=Cooler(settings.cooler_w, settings.cooler_lag_s),
        probe=probe,
        second=second if settings.second_sensor else None,
    )


def _acquisition_parameters(settings: SimulatedSettings) -> AcquisitionParameters:
    """Return the converter, its burst laid over whole mains periods."""
    return AcquisitionParameters(
        bits=settings.bits,
        reference_v=settings.reference_v,
        conversions=settings.conversions,
        burst_s=MAINS_PERIODS_A_BURST / settings.mains_hz,
        noise_v=1e-3 * settings.noise_mv,
        pickup_v=1e-3 * settings.pickup_mv,
        mains_hz=settings.mains_hz,
    )
