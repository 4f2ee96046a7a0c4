"""The boundary to laws from entry points: whatever one raises, the loop goes on."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, TypeVarTuple

from thermoctl.regulator.supervisor import Supervisor

T = TypeVar("T")
Given = TypeVarTuple("Given")

_FAULT = 58


@dataclass(frozen=True, slots=True)
class Failure:
    """What a law raised: in a sentence, and where."""

    text: str
    trace: str


def attempt(law: Callable[[*Given], T], *given: *Given) -> T | Failure:
    """Return what `law` makes of what is `given`, or what it raised.

    Anything may come out of a plug-in, so this file is the one place below the loop where every
    exception is caught.
    """
    try:
        return law(*given)
    except Exception as error:  # noqa: BLE001 - the boundary to third-party laws
        return _failure(error)


def _failure(error: Exception) -> Failure:
    """Return in words what is being handled."""
    text = str(error)
    if not text.startswith("expected "):  # it says what was expected, and what came
        text = f"expected a result, got {type(error).__name__}: {text}"
    return Failure(text, traceback.format_exc())


@dataclass(frozen=True, slots=True)
class Guard:
    """Calls what a law offers; a call that raises costs the heat, never the loop.

    Parameters
    ----------
    supervisor : Supervisor
        Who goes to SAFE when a law has failed, and says so once.
    """

    supervisor: Supervisor

    def call(
        self, code: str, t_s: float, otherwise: T, law: Callable[[*Given], T], *given: *Given
    ) -> T:
        """Return what `law` makes of what is `given`; `otherwise` after the fault `code`."""
        try:
            return law(*given)
        except Exception as error:  # noqa: BLE001 - the boundary to third-party laws
            failure = _failure(error)
            self.supervisor.fail(code, _FAULT, failure.text, t_s, trace=failure.trace)
            return otherwise
