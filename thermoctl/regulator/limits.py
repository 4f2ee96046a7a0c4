"""The limits a supervisor keeps, and how fast its states give way to each other."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from thermoctl.errors import Refused
from thermoctl.quantities import clamp, is_finite_number

_APPLIED_TOLERANCE = 0.1
_NO_FINITE_NUMBER = ("rise_per_s", "jump_widens", "power_cools")


@dataclass(frozen=True, slots=True)
class Limits:
    """What a loop may never leave, whatever its controller asks for.

    Parameters
    ----------
    trip_above_c, trip_below_c : float
        Limits in degC beyond which all is off until acknowledged: power 0 at the first reading,
        latched at the second.
    setpoint_min_c, setpoint_max_c : float
        Range of set points that are accepted, inside the trips.
    period_s : float
        Nominal time between two samples.
    power_max : float
        Most power ever given, a fraction in (0, 1].
    rise_per_s : float
        Most the power may move away from 0 in a second; falling is never slowed. Infinite: no
        limit.
    jump_k : float
        A reading farther than this from the last good one, and far from the usual step between
        readings as well, is an outlier.
    applied_tolerance : float
        The hardware may take this much more than it was told before it counts as a fault.
    window_s, cooler_window_s : float
        How long heater or cooler may take over a command, at most: the window in which it takes its
        power anew, or the least time it stays on. As many seconds of full power may be
        reported beyond the commands before that is a fault; 0: two reports in a row are one.
    jump_widens : bool
        Whether a reading may also lie as far off as the gain that is believed in explains.
    power_min : float
        Least power ever given, in [-1, 0]: below 0 it is a cooler's; 0: there is none beside the
        heater.
    changeover_s : float
        How long both are off before the other one of the two begins; never less than a period.
    power_cools : bool
        Whether the one actuator is a cooler, and power takes heat out.
    """

    trip_above_c: float
    trip_below_c: float
    setpoint_min_c: float
    setpoint_max_c: float
    period_s: float = 1.0
    power_max: float = 1.0
    rise_per_s: float = math.inf
    jump_k: float = 1.0
    applied_tolerance: float = _APPLIED_TOLERANCE
    jump_widens: bool = True
    power_min: float = 0.0
    changeover_s: float = 0.0
    power_cools: bool = False
    window_s: float = 0.0
    cooler_window_s: float = 0.0

    APPLIED_TOLERANCE = _APPLIED_TOLERANCE
    HOLD_S = 3.0
    """Longest time in s for which HOLD keeps the last output."""
    RIDE_S = 60.0
    """Longest time in s for which RIDE lets the model steer."""
    RIDE_ALARM_S = 5.0
    RETURN_S = 30.0
    """Time in s of good readings that ends SAFE."""
    OPEN_COUNT = 3
    OPEN_WINDOW_S = 600.0
    """Time in s within which OPEN_COUNT open circuits latch."""
    STEEPEST_K_PER_S = 0.5
    """Largest gain in K/s that widens the jump while it is a guess: 1,500 W in 0.7 l of water."""
    KNOWN_SHARE = 0.5
    """A gain with two standard deviations of at most this share of it is no guess any more."""
    WIDEST_K = 10.0
    """Largest jump in K, whatever gain and period: half of a plain spike."""
    OUTLIERS = 2
    """Number of outliers in a row that are ignored; the next one that agrees with them is
    believed."""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name not in _NO_FINITE_NUMBER and not is_finite_number(value):
                raise ValueError(f"{each.name} must be a finite number, got {value!r}")
        if not self.trip_below_c <= self.setpoint_min_c <= self.setpoint_max_c <= self.trip_above_c:
            raise ValueError(
                "expected trip_below_c <= setpoint_min_c <= setpoint_max_c <= trip_above_c, got "
                f"{self.trip_below_c}, {self.setpoint_min_c}, {self.setpoint_max_c}, "
                f"{self.trip_above_c}"
            )
        for name in ("period_s", "rise_per_s", "jump_k", "applied_tolerance", "power_max"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)!r}")
        if self.power_max > 1.0:
            raise ValueError(f"power_max is a fraction of full power, got {self.power_max!r}")
        if not -1.0 <= self.power_min <= 0.0:
            raise ValueError(f"power_min must lie in [-1, 0], got {self.power_min!r}")
        for name in ("changeover_s", "window_s", "cooler_window_s"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} must be at least 0, got {getattr(self, name)!r}")
        if self.power_cools and self.power_min < 0.0:
            raise ValueError("power_min must be 0 where power_cools: there is one actuator")

    @property
    def can_heat(self) -> bool:
        """Whether an actuator brings heat in."""
        return not self.power_cools

    @property
    def can_cool(self) -> bool:
        """Whether an actuator takes heat out."""
        return self.power_cools or self.power_min < 0.0

    def possible(self, power: object) -> float:
        """Return `power` limited to what actuators can take, [0, 1] or [-1, 1]; else 0."""
        low = -1.0 if self.power_min < 0.0 else 0.0
        return clamp(float(power), low, 1.0) if is_finite_number(power) else 0.0  # type: ignore[arg-type]

    @property
    def hold_s(self) -> float:
        """How long an output is kept without a reading; a slow loop may miss one."""
        return max(self.HOLD_S, 1.5 * self.period_s)

    @property
    def unsteady_s(self) -> float:
        """How long an output is kept while readings come that are outliers.

        Long enough for the third one, which may be the truth, also where the period is long.
        """
        return max(self.hold_s, (self.OUTLIERS + 0.5) * self.period_s)

    def seen_s(self, interval_s: float) -> float:
        """Return how much of the time since the last sample a good reading answers for."""
        return interval_s if interval_s <= self.HOLD_S else min(interval_s, self.hold_s)

    def jump_for(self, gain: float, gain_sd: float) -> float:
        """Return `jump_k`, or what a plant of the largest gain believed in may do.

        That is twice its rise in a period at full power, as long as the gain is two standard
        deviations above its mean. A plant never seen before is thus given its way, while one that
        is known narrows the jump again. Only a gain that is known may be steeper than that of
        any water: a guess would call the rise of a dry element a plant.

        Parameters
        ----------
        gain, gain_sd : float
            Rise at full power and its standard deviation, in K/s; NaN where nothing is believed.
        """
        size, error = abs(gain), 2.0 * gain_sd
        known = 0.0 < error <= self.KNOWN_SHARE * size  # an error of 0: none was told
        largest = size + error if known else min(size + error, self.STEEPEST_K_PER_S)
        explained_k = min(2.0 * largest * self.period_s, self.WIDEST_K)
        return explained_k if self.jump_widens and explained_k > self.jump_k else self.jump_k

    def accept_setpoint(self, value: object) -> float:
        """Return `value` as a set point in degC; raise `Refused` naming the range."""
        allowed = f"a set point from {self.setpoint_min_c:g} to {self.setpoint_max_c:g} degC"
        if not is_finite_number(value):
            raise Refused(f"expected {allowed}, got {value!r}")
        number = float(value)  # type: ignore[arg-type]
        if not self.setpoint_min_c <= number <= self.setpoint_max_c:
            raise Refused(f"expected {allowed}, got {number:g}")
        return number

    def accept_power(self, value: object) -> float:
        """Return `value` as a power the loop can take; raise `Refused` naming the range."""
        if not is_finite_number(value) or self.possible(value) != value:
            low = "-1" if self.power_min < 0.0 else "0"
            raise Refused(f"expected a power from {low} to 1, got {value!r}")
        return float(value)


def command_lasts_s(period_s: float) -> float:
    """Return how long a command may outlive its sample, for a loop of this period."""
    return 1.5 * period_s + 1.0
