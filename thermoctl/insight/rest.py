"""Whether a loop is at rest: held, and not moved on purpose."""

from __future__ import annotations

import math

from thermoctl.signals import Mode, Quality, State, Step

BAND_K, BAND_NOISES = 0.3, 10.0
"""Largest distance from the set point at rest: in K and in deviations of the noise, the larger of
the two."""

QUIET_S = 60.0
"""Length in s below which a rest does not part one move from the next."""

MOVED_K = 0.05
"""Least move in K of a set point that counts."""


class Rest:
    """Follows mode, set point and deviation.

    `since_s` is the time since which the loop is at rest, NaN while it is not; `moved_s` that at
    which somebody began to move it: the first sample, another set point, mode or state. Moves that
    follow before it was at rest for `QUIET_S`, as on a ramp, are one.
    """

    def __init__(self) -> None:
        self.since_s = self.moved_s = math.nan
        self._wanted: tuple[Mode, State] | None = None
        self._setpoint_c = math.nan

    def after(self, step: Step, noise_sd_k: float) -> bool:
        """Take a step; return whether it was moved on purpose just now."""
        wanted = (step.mode, step.state)
        moved = wanted != self._wanted or not abs(step.setpoint_c - self._setpoint_c) <= MOVED_K
        if moved:
            self._wanted, self._setpoint_c = wanted, step.setpoint_c
            if math.isnan(self.moved_s) or self.lasts_s(step.t_s) >= QUIET_S:
                self.moved_s = step.t_s
            self.since_s = math.nan
        if step.measurement.quality is not Quality.GOOD:
            return moved
        band_k = max(BAND_K, BAND_NOISES * noise_sd_k)
        away_k = abs(step.measurement.temperature_c - step.setpoint_c)
        held = step.mode is Mode.AUTO and step.state is State.RUN and away_k <= band_k
        if not held:
            self.since_s = math.nan
        elif math.isnan(self.since_s):
            self.since_s = step.t_s
        return moved

    def lasts_s(self, t_s: float) -> float:
        """Return for how long the loop is at rest; 0 when it is not."""
        return 0.0 if math.isnan(self.since_s) else t_s - self.since_s
