"""One measurement in, one step out: modes, limits, trips, alarms."""

from thermoctl.regulator.limits import Limits
from thermoctl.regulator.regulator import Plan, Regulator

__all__ = ["Limits", "Plan", "Regulator"]
