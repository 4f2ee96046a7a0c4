"""What may be asked of a loop: granted or refused at the top of a cycle."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Mode(StrEnum):
    """What the operator wants."""

    OFF = "off"
    MANUAL = "manual"
    AUTO = "auto"
    PROGRAM = "program"


@dataclass(frozen=True, slots=True)
class SetPoint:
    """Request: hold `value_c`, at most at `rate_k_per_min`; None: as configured."""

    value_c: float
    rate_k_per_min: float | None = None


@dataclass(frozen=True, slots=True)
class ManualPower:
    """Request: give `power` in mode MANUAL: in [0, 1], with a cooler in [-1, 1]."""

    power: float


@dataclass(frozen=True, slots=True)
class Load:
    """Request: expect the plant to lose `power` more, for `duration_s` from now on.

    A fraction of full power in [-1, 1], instead of a load that was announced before; 0 ends it.
    """

    power: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """Request: acknowledge `code`, or all; clears a latch without a cause."""

    code: str | None = None


@dataclass(frozen=True, slots=True)
class ChooseController:
    """Request: put the controller called `name` in charge, its rival in the shadow."""

    name: str


@dataclass(frozen=True, slots=True)
class ChooseShadow:
    """Request: put `law`, a `Controller`, in the shadow; None: nobody.

    It begins there with nothing learnt. It can be put in charge at any time: what it has learnt by
    then is told by its beliefs and its score, and nothing checks that it is enough.
    """

    law: Any


Request = Mode | SetPoint | ManualPower | Load | ChooseController | ChooseShadow | Acknowledge
