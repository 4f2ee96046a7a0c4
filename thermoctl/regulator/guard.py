"""The boundary to laws from entry points: whatever one raises, the loop goes on."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from thermoctl.regulator.supervisor import Supervisor

T = TypeVar("T")

_FAULT = 58


@dataclass(frozen=True, slots=True)
class Failure:
    """What a law raised: in a sentence, and where."""

    text: str
    trace: str


def attempt(law: Callable[[], T]) -> T | Failure:
    """Return what `law` returns, or what it raised.

    Anything may come out of a plug-in, so this is the one place below the loop where every
    exception is caught.
    """
    try:
        return law()
    except Exception as error:  # noqa: BLE001 - the boundary to third-party laws
        text = f"expected a result, got {type(error).__name__}: {error}"
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

    def call(self, law: Callable[[], T], otherwise: T, code: str, t_s: float) -> T:
        """Return what `law` returns, or `otherwise` after the fault `code`."""
        came = attempt(law)
        if isinstance(came, Failure):
            self.supervisor.fail(code, _FAULT, came.text, t_s, trace=came.trace)
            return otherwise
        return came
