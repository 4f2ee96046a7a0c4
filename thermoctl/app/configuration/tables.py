"""The tables of a configuration: typed, units in names, unknown keys refused."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from thermoctl.app.configuration.bases import Celsius, Finite, Options, Positive, Table
from thermoctl.app.configuration.device_tables import (
    Actuator,
    ActuatorTable,
    CascadeTable,
    CoolerTable,
    SensorTable,
)
from thermoctl.estimation import LainiotisBank, Order
from thermoctl.quantities import WATER_J_PER_L_K
from thermoctl.signals import Mode

Past = Annotated[int, Field(le=10)]
Delay = Annotated[int, Field(le=120)]
FirstMode = Literal[Mode.OFF, Mode.MANUAL, Mode.AUTO]
"""What a loop can start in; a program has to be loaded first."""


class GuardsTable(Table):
    """Table ``[loops.NAME.estimator.guards]``: what keeps learning sound for years."""

    enabled: bool = Field(True, description="False: the bare law, as printed.")
    covariance_max: Positive | None = Field(
        None,
        description="Cap on the diagonal of P; when absent P0 for structure arx, and for "
        "known-gain the square of gain over set point, at most R2 times period over reference time "
        "over the square of the set point.",
    )
    excitation_min: Positive | None = Field(
        None,
        description="Learn only while the regressor moves more than this; when absent 0.1 for "
        "structure arx, and off for known-gain, whose learning at rest is its integral action.",
    )
    robust_R2: bool = Field(  # noqa: N815 - R2 keeps its letter
        True,
        description="Estimate R2 beside a Kalman filter; with structure known-gain the estimate "
        "may only raise it.",
    )


NOISES = {kind: {"R1": 1e-8, "R2": 0.1} for kind in ("ckf", "nkf")}
"""What a loop's filter has where nothing is said: a loss that drifts, noise for a missing lag."""


class EstimatorTable(Options):
    """Table ``[loops.NAME.estimator]``: the law that learns the model."""

    kind: str = Field("ckf", description="ckf, nkf, rls, vff, or one from a plug-in.")
    P0: Positive = Field(
        1.0, description="Variance of the parameters at the start; at most the guards' cap."
    )
    theta0: tuple[Finite, ...] | None = Field(
        None,
        description="Parameters at the start; if absent no loss and the model's gain.",
    )
    guards: GuardsTable = Field(default_factory=GuardsTable)

    @property
    def options(self) -> dict[str, Any]:
        """Every key of the law, the noises of a loop included."""
        return {**NOISES.get(self.kind, {}), **super().options}


class ModelTable(Table):
    """Table ``[loops.NAME.model]``: the structure that is learnt."""

    structure: Literal["known-gain", "arx"] = Field(
        "known-gain",
        description="known-gain: y(t) = a y(t-1) + b u(t-1), b given; arx: everything learnt.",
    )
    gain_k_per_s: Annotated[float, Field(gt=0.0, le=1e6)] = Field(
        0.0449,
        description="Heating rate at full power; left out, what the loop's `heater_w` does to its "
        "`volume_l`, and without these 0.0449, which is 1,500 W in 8 l. arx: the first guess, and "
        "a fifth of it the least gain that is believed while the guards are on.",
    )
    n: Past = Field(2, ge=1, description="arx: how many past temperatures.")
    m: Past = Field(2, ge=1, description="arx: how many past powers.")
    delay: Delay = Field(
        1, ge=1, description="arx: samples from a power to its first effect; 1: the next."
    )
    centre_c: Celsius = Field(
        20.0, description="arx: temperatures are counted from here; where the plant rests at 0 W."
    )
    scale_k: Positive = Field(1.0, description="arx: temperatures are counted in units of this.")

    @model_validator(mode="after")
    def _a_known_gain_acts_at_once(self) -> Self:
        if self.structure == "known-gain" and self.delay != 1:
            raise ValueError(f"delay must be 1 unless structure is 'arx', got {self.delay}")
        return self


class HeaterCheckTable(Table):
    """Table ``[loops.NAME.heater_check]``: whether the reading answers to the power."""

    enabled: bool = Field(
        True, description="Compare them, and ask a heater in doubt by cutting its power."
    )
    weakest_k_per_s: Annotated[float, Field(ge=1e-6, le=0.5)] | None = Field(
        None,
        description="Least rise at full power, in K/s, that a healthy plant can have; left out, "
        "a fifth of what `heater_w` does to `volume_l`, without litres what it does to 400 l of "
        "water, and without watts 6e-5, which is 50 W in 200 l. The more is said, the less a "
        "heater that was never seen to heat may give before it is called a fault.",
    )
    first_heat_s: Annotated[float, Field(ge=10.0, le=3600.0)] = Field(
        60.0,
        description="Seconds of full power in which such a heater has to show a rise, or is asked; "
        "under a lower `power_max` they are divided by its square. Behind a long pipe, twice the "
        "time from power to reading.",
    )


class OrdersTable(Table):
    """Table ``[loops.NAME.orders]``: orders weighed beside the loop."""

    enabled: bool = Field(True, description="Weigh them; false: as if the table were not there.")
    candidates: tuple[tuple[Past, Past, Delay], ...] | None = Field(
        None,
        max_length=200,
        description="Past temperatures, powers and delay of each, at most 10, 10 and 120; the "
        "72 of `replay --order auto` when absent.",
    )

    @field_validator("candidates")
    @classmethod
    def _candidates_differ(
        cls, value: tuple[tuple[int, int, int], ...] | None
    ) -> tuple[tuple[int, int, int], ...] | None:
        if value is not None:
            LainiotisBank([Order(*each) for each in value], floor=0.0)
        return value


class LoopTable(Table):
    """Table ``[loops.NAME]``: what is held, how often, and within which limits."""

    setpoint_c: Celsius = Field(description="Temperature to hold.")
    trip_above_c: Celsius = Field(description="All off above this until acknowledged.")
    trip_below_c: Celsius = Field(-10.0, description="All off below this until acknowledged.")
    setpoint_min_c: Celsius | None = Field(None, description="Least set point; the trip if absent.")
    setpoint_max_c: Celsius | None = Field(
        None, description="Highest set point; the trip if absent."
    )
    setpoint_rate_k_per_min: Positive | None = Field(
        None,
        description="How fast a set point is approached, at most; when absent at once. It begins "
        "where the plant is.",
    )
    period_s: Annotated[float, Field(ge=0.05, le=3600.0)] = Field(
        1.0, description="Time between two samples."
    )
    mode: FirstMode = Field(Mode.OFF, description="Mode at the first start: off, manual or auto.")
    resume: bool = Field(False, description="Go on after a restart; else a restarted loop is off.")
    power_max: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        1.0, description="Most power ever given, as a fraction."
    )
    rise_per_s: Positive | None = Field(
        None, description="Most the power may move away from 0 in a second."
    )
    heater_w: Positive | None = Field(
        None,
        description="Rated power of the heater in W; with it, watts and litres are told, and a "
        "heater that was never seen to heat is checked by what so much does at least.",
    )
    volume_l: Annotated[float, Field(ge=0.01, le=1e6)] | None = Field(
        None,
        description="Water that it warms, in l; with it, a heater that fails before it was ever "
        "seen to heat, or a sensor beside its tank, is told within minutes instead of hours.",
    )
    jump_k: Positive = Field(
        1.0,
        description="A reading farther off than this may be an outlier; left out, it is at least "
        "twice the rise in a period at full power, with the gain that is configured or the largest "
        "that the controller believes in; and 25 for a loop that follows another one.",
    )
    sensor: SensorTable | None = None
    second_sensor: SensorTable | None = Field(
        None,
        description="Table `[loops.NAME.second_sensor]`, as the first: another sensor of the same "
        "plant, on this or another board; none when absent.",
    )
    disagreement_k: Positive = Field(
        1.0,
        description="How far apart two sensors may be, beside what their lags explain, before the "
        "hotter one alone is followed and an alarm says so.",
    )
    actuator: Actuator | None = Field(
        None,
        description="Table `[loops.NAME.actuator]`: which output, and how power becomes its drive; "
        "or which loop follows, and how power becomes its set point.",
    )
    cooler: CoolerTable | None = None
    controller: Options = Field(
        default_factory=lambda: Options(kind="adaptive"),
        description="Law in charge in mode auto: a kind, or a table with a kind and its options.",
    )
    shadow: Options | None = Field(
        None,
        description="Another law, as in `controller`: asked beside it, logged, never obeyed; it "
        "can be put in charge while the loop runs.",
    )
    model: ModelTable = Field(default_factory=ModelTable)
    estimator: EstimatorTable = Field(default_factory=EstimatorTable)
    orders: OrdersTable | None = Field(
        None, description="Table of the orders that are weighed beside the loop; none when absent."
    )
    heater_check: HeaterCheckTable = Field(default_factory=HeaterCheckTable)

    @field_validator("controller", "shadow", mode="before")
    @classmethod
    def _a_kind_alone_is_a_controller(cls, value: Any) -> Any:
        return {"kind": value} if isinstance(value, str) else value

    @model_validator(mode="after")
    def _setpoint_within_limits_within_trips(self) -> Self:
        low_c, high_c = self.setpoint_range_c
        coldest_c, hottest_c, held_c = self.trip_below_c, self.trip_above_c, self.setpoint_c
        trip = f"trip_above_c ({hottest_c:g})"
        if not coldest_c < hottest_c:
            raise ValueError(f"trip_below_c must be less than {trip}, got {coldest_c:g}")
        if not coldest_c <= low_c <= hottest_c:
            text = f"must be from trip_below_c ({coldest_c:g}) to {trip}, got {low_c:g}"
            raise ValueError(f"setpoint_min_c {text}")
        if not low_c <= high_c <= hottest_c:
            text = f"must be from the least set point ({low_c:g}) to {trip}, got {high_c:g}"
            raise ValueError(f"setpoint_max_c {text}")
        if not (low_c <= held_c <= high_c and held_c < hottest_c):
            text = f"must be from {low_c:g} to {high_c:g} and below {trip}, got {held_c:g}"
            raise ValueError(f"setpoint_c {text}")
        return self

    @model_validator(mode="after")
    def _litres_need_watts(self) -> Self:
        if self.volume_l is not None and self.heater_w is None:
            raise ValueError("heater_w must be the watts that warm volume_l, got none")
        return self

    @property
    def gain_k_per_s(self) -> float:
        """Heating rate at full power in K/s: that of the model, or of watts and litres."""
        given = "gain_k_per_s" in self.model.model_fields_set
        if given or self.heater_w is None or self.volume_l is None:
            return self.model.gain_k_per_s
        return self.heater_w / (WATER_J_PER_L_K * self.volume_l)

    @property
    def outputs(self) -> tuple[ActuatorTable, ...]:
        """The outputs that this loop drives, the heater's or the only one first."""
        both = (self.actuator, self.cooler)
        return tuple(each for each in both if isinstance(each, ActuatorTable))

    @property
    def leads(self) -> CascadeTable | None:
        """The loop that this one leads, None where it drives outputs."""
        return self.actuator if isinstance(self.actuator, CascadeTable) else None

    @property
    def weighs_orders(self) -> bool:
        """Whether orders are weighed beside this loop."""
        return self.orders is not None and self.orders.enabled

    @property
    def setpoint_range_c(self) -> tuple[float, float]:
        """Least and highest set point that is accepted, in degC."""
        low_c = self.trip_below_c if self.setpoint_min_c is None else self.setpoint_min_c
        high_c = self.trip_above_c if self.setpoint_max_c is None else self.setpoint_max_c
        return low_c, high_c

    @property
    def setpoint_rate_k_per_s(self) -> float:
        """How fast a set point is approached, at most; infinite when not limited."""
        rate_k_per_min = self.setpoint_rate_k_per_min
        return math.inf if rate_k_per_min is None else rate_k_per_min / 60.0

    @property
    def rise_limit_per_s(self) -> float:
        """Most the power may rise in a second, infinite when not limited."""
        return math.inf if self.rise_per_s is None else self.rise_per_s


class HistoryTable(Table):
    """Table ``[history]``: the record of every step."""

    enabled: bool = Field(True, description="Write every step into the state directory.")
    file: str = Field("history.sqlite", min_length=1, description="Name, or an absolute path.")


class ServiceTable(Table):
    """Table ``[service]``: how the daemon behaves."""

    state_directory: str | None = Field(
        None, description="Folder of latches and history, when it is not the usual one."
    )
    accept_no_dead_man: bool = Field(
        False, description="Run a board that cannot switch its output off by itself."
    )
