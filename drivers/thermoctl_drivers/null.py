"""A board that reads what it is told and writes nowhere: a dry run."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from thermoctl.errors import BoardConfigError, LinkError
from thermoctl.ports import Capabilities, Clock, Health, Identity, Link
from thermoctl.quantities import ZERO_CELSIUS_K
from thermoctl.signals import RawSample
from thermoctl_drivers.outputs import commanded

INPUT = "temperature"
OUTPUT = "heater"

_LM335_V_PER_K = 0.01


class NullSettings(BaseModel):
    """Table ``[boards.NAME]`` with ``kind = "null"``: what it shall have read."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kind: Literal["null"] = "null"
    temperature_c: float = Field(
        25.0, ge=-40.0, le=150.0, description="Read as an LM335 would show it, in degC."
    )
    counts: float | None = Field(None, ge=0.0, description="Read these counts instead.")
    full_scale: float = Field(65536.0, gt=1.0, description="Counts at the reference voltage.")
    reference_v: float = Field(5.0, gt=0.0, le=100.0, description="Reference voltage, in V.")

    @model_validator(mode="after")
    def _counts_fit_the_converter(self) -> Self:
        if self.reading >= self.full_scale:
            raise ValueError(f"counts must lie below {self.full_scale:g}, got {self.reading:g}")
        return self

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the channels that are read."""
        return (INPUT,)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the channels that may be written."""
        return (OUTPUT,)

    @property
    def reading(self) -> float:
        """The counts to read."""
        if self.counts is not None:
            return self.counts
        volts = _LM335_V_PER_K * (self.temperature_c + ZERO_CELSIUS_K)
        return float(round(volts / self.reference_v * self.full_scale))


class NullBoard:
    """Dry run: one input that stands still or is injected, an output to nowhere.

    Parameters
    ----------
    settings : NullSettings
        What it reads.
    link : Link or None
        Not used; there is no wire.
    clock : Clock
        Stamps the samples.
    """

    Settings: ClassVar[type[NullSettings]] = NullSettings
    transport: ClassVar[str] = "none"
    # What gives no power has no power to cut.
    capabilities: Capabilities = Capabilities(dead_man=True)

    def __init__(self, settings: NullSettings, link: Link | None, clock: Clock) -> None:
        del link  # every driver is built alike
        self._settings, self._clock = settings, clock
        self._reading: float | None = settings.reading
        self._is_open = False
        self._counters: Counter[str] = Counter(reads=0, writes=0)
        self._last_good_s: float | None = None

    def inject(self, counts: float | None) -> None:
        """Read `counts` from now on; None: the input does not answer.

        Raises
        ------
        BoardConfigError
            When no converter of this scale could show them.
        """
        if counts is not None and not 0.0 <= counts < self._settings.full_scale:
            raise BoardConfigError(
                f"counts must lie in 0..{self._settings.full_scale:g}, got {counts!r}"
            )
        self._reading = counts

    def open(self, deadline_s: float) -> Identity:
        """Say who it is; at once, whatever `deadline_s`."""
        del deadline_s
        self._is_open = True
        return Identity(kind="null", name="dry run", version="1")

    def read(self, deadline_s: float) -> Mapping[str, RawSample]:
        """Return the constant, or what was injected; `LinkError` when not open."""
        del deadline_s
        self._check_open()
        self._counters["reads"] += 1
        if self._reading is None:
            return {}
        now_s = self._last_good_s = self._clock.now_s()
        sequence = self._counters["reads"]
        return {INPUT: RawSample(now_s, self._reading, self._settings.full_scale, sequence)}

    def write(
        self, outputs: Mapping[str, float], valid_for_s: float, deadline_s: float
    ) -> Mapping[str, float]:
        """Take no power, whatever is asked, and say so.

        Raises
        ------
        LinkError
            When it is not open.
        BoardConfigError
            When there is no such output.
        FaultError
            When the power or the time is infinite or no number.
        """
        del deadline_s
        self._check_open()
        if unknown := sorted(set(outputs) - {OUTPUT}):
            raise BoardConfigError(f"the only output is {OUTPUT!r}, got {unknown}")
        for name, power in outputs.items():
            commanded(name, power, valid_for_s, math.inf)  # a dry run shows what a board refuses
        self._counters["writes"] += 1
        return dict.fromkeys(outputs, 0.0)

    def health(self) -> Health:
        """Return ``ok`` while it is open."""
        status = "ok" if self._is_open else "down"
        return Health(status, dict(self._counters), self._last_good_s)

    def close(self) -> None:
        """Let nothing go; idempotent."""
        self._is_open = False

    def _check_open(self) -> None:
        if not self._is_open:
            raise LinkError("expected an open board, it is closed")
