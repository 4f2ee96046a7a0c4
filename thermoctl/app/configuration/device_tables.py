"""The tables of what a loop is wired to: sensors, outputs, another loop."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from thermoctl.app.configuration.bases import Celsius, Finite, Fraction, Positive, Table


class SensorTable(Table):
    """Table ``[loops.NAME.sensor]``: which input, and what its counts mean."""

    board: str = Field(description="Name of the board in [boards.NAME].")
    input: str = Field("temperature", description="Channel of the board.")
    curve: Literal["lm335", "lm35", "tmp36", "pt100", "pt1000", "ntc", "linear"] = Field(
        "lm335", description="Law from volts to degC."
    )
    reference_v: Positive = Field(5.0, description="Volts at full scale of the converter.")
    calibration_gain: float = Field(
        1.0, ge=0.8, le=1.25, description="One-point calibration: a factor on volts."
    )
    calibration_offset_k: float = Field(0.0, ge=-20, le=20, description="Added after the curve.")
    pull_up_ohm: Positive | None = Field(None, description="Series resistor of pt100, pt1000, ntc.")
    supply_v: Positive | None = Field(None, description="Voltage across it; reference_v if absent.")
    beta_k: Positive = Field(3950.0, description="Beta of an ntc.")
    r25_ohm: Positive = Field(10_000.0, description="Resistance of an ntc at 25 degC.")
    kelvin_per_v: Finite = Field(100.0, description="Slope of a linear sensor.")
    zero_v_c: Finite = Field(0.0, description="Temperature of a linear sensor at 0 V.")
    open_above: Fraction = Field(0.98, description="Fraction of full scale that means: open.")
    short_below: Fraction = Field(0.02, description="Fraction of full scale that means: short.")

    @model_validator(mode="after")
    def _resistive_sensors_need_a_pull_up(self) -> Self:
        if self.curve in ("pt100", "pt1000", "ntc") and self.pull_up_ohm is None:
            raise ValueError(
                f"pull_up_ohm must be the resistor that a {self.curve} is read with, got none"
            )
        return self


class ActuatorTable(Table):
    """Table ``[loops.NAME.actuator]``: which output, and how power becomes its drive."""

    board: str = Field(description="Name of the board in [boards.NAME].")
    output: str = Field("heater", description="Channel of the board.")
    law: Literal["linear", "square", "phase-angle", "burst"] = Field(
        "linear", description="linear: the board takes power itself; square: P ~ V^2; ..."
    )
    cycles: int = Field(50, ge=1, description="Mains cycles of one burst, for law burst.")
    window_s: Annotated[float, Field(ge=0.0, le=600.0)] = Field(
        0.0,
        description="How late the output may obey: its window, or the least time it stays on; what "
        "it reports beyond the command for longer is a fault.",
    )


class CascadeTable(Table):
    """Table ``[loops.NAME.actuator]`` of a loop that gives another one its set point."""

    loop: str = Field(description="Name of the loop that follows.")
    low_c: Celsius = Field(description="Its set point at power 0.")
    high_c: Celsius = Field(description="Its set point at full power.")

    @model_validator(mode="after")
    def _low_below_high(self) -> Self:
        if not self.low_c < self.high_c:
            raise ValueError(
                f"low_c must be less than high_c ({self.high_c:g}), got {self.low_c:g}"
            )
        return self


def _what_acts(value: Any) -> str:
    """Return which of the two tables of an actuator `value` is: it has a loop, or a board."""
    leads = "loop" in value if isinstance(value, dict) else isinstance(value, CascadeTable)
    return "<loop>" if leads else "<board>"


Actuator = Annotated[
    Annotated[ActuatorTable, Tag("<board>")] | Annotated[CascadeTable, Tag("<loop>")],
    Discriminator(_what_acts),
]
"""An output, or another loop. Its tags are in brackets, for no key is: a path leaves them out."""


class CoolerTable(ActuatorTable):
    """Table ``[loops.NAME.cooler]``: the output of a power below 0, which cools."""

    output: str = Field("cooler", description="Channel of the board.")
    power_max: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        1.0, description="Most of its power ever given, as a fraction."
    )
    changeover_s: Annotated[float, Field(ge=0.0, le=3600.0)] = Field(
        0.0,
        description="How long heater and cooler are both off before the other one begins; never "
        "less than a period.",
    )
