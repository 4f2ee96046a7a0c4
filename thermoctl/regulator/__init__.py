"""One measurement in, one step out: modes, limits, trips, alarms."""

from thermoctl.regulator.limits import Limits
from thermoctl.regulator.plan import Plan
from thermoctl.regulator.regulator import Regulator

__all__ = ["Limits", "Plan", "Regulator"]
