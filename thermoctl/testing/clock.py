"""Time under control."""

from thermoctl.runtime.clock import SimulatedClock


class ManualClock(SimulatedClock):
    """Time that moves only when somebody sleeps, or calls `advance`."""
