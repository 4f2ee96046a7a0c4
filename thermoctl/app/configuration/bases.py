"""What every table of a configuration has in common."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

Celsius = Annotated[float, Field(ge=-273.15, le=2000.0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Table(BaseModel):
    """A table whose keys are all known; frozen once it is read."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False
    )


class Options(BaseModel):
    """A table that names a ``kind``; its other keys are the options of that kind."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    kind: str = Field(description="Which one; `thermoctl drivers` and the manual list them.")

    @property
    def options(self) -> dict[str, Any]:
        """Every key but ``kind``."""
        return dict(self.__pydantic_extra__ or {})
