"""Which fault a drift looks like, and the sentence that says so.

What cannot be told apart is not told apart: more power to hold is a lid that is off as well as an
element that is weak, until the gain was assayed. A stirrer that stops moves the lag by less than
its own error, and so has no name here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from thermoctl.insight.drifts import Baseline, Compared, Hysteresis
from thermoctl.insight.values import Drift
from thermoctl.insight.wording import plain
from thermoctl.quantities import Uncertain

ELEMENT, LOSS, WATER, WIRING = "element.weak", "loss.up", "water.low", "wiring.noisy"

TURN_S, TURN_LAGS = 300.0, 15.0
"""Time from one look at power and noise to the next: in s and in lags, the longer of the two."""
LEARNT, MEMORY, RECENT = 4, 24, 2
"""Number of such turns that a baseline is learnt from, followed over, and compared with."""
POWER_UP, POWER_LEAST = 0.2, 0.02
"""Increase of the holding power that is a drift: as a share of it, and as a fraction of full
power."""
NOISE_UP = 1.0
"""Increase of the noise that is a drift, as a share: twice as much."""
GAIN_UP, GAIN_DOWN = 0.25, -0.2
"""Change of the gain of a move that is a drift, as a share."""
UNLIKE = 0.06
"""Share by which gains of unlike moves differ on an unchanged plant: the glass follows later."""
NORMAL_AFTER = 48
"""Number of turns after which a holding power that stays up is the usual one."""


Words = Callable[[Compared], str]


class Faults:
    """Names what drifts.

    `active` holds the drifts that stand, by name.
    """

    def __init__(self) -> None:
        self._active: dict[str, Drift] = {}
        self._more_power, self._more_noise = Hysteresis(POWER_UP, 2), Hysteresis(NOISE_UP, 2)
        self._water, self._element = Hysteresis(GAIN_UP, 1), Hysteresis(GAIN_DOWN, 1)
        self._first: Uncertain | None = None
        self._diluted = 1.0
        self._up_for = 0
        self._noise = Baseline(LEARNT, MEMORY, RECENT)
        self.settle_anew()

    def settle_anew(self) -> None:
        """Begin new baselines of what depends on the set point."""
        self._power = Baseline(LEARNT, MEMORY, RECENT)

    @property
    def active(self) -> Mapping[str, Drift]:
        """The drifts that stand, by name."""
        return MappingProxyType(self._active)

    # -- what is seen ----------------------------------------------------------------------------

    def turn(self, t_s: float, power: float, noise_sd_k: float) -> None:
        """Take the mean power of a turn at rest, and the noise at its end."""
        compared = self._power.after(power, follow=not self._more_power.stands)
        if compared is not None:
            least = compared.now.mean - compared.before.mean > POWER_LEAST
            if least or self._more_power.stands:
                self._more_power.after(compared)
            self._up_for = self._up_for + 1 if self._more_power.stands else 0
            if self._up_for > NORMAL_AFTER:
                self._more_power.end()
                self.settle_anew()
            weak = ELEMENT in self._active
            self._tell(LOSS, self._more_power.stands and not weak, t_s, compared, _loss_words)
        compared = self._noise.after(noise_sd_k, follow=not self._more_noise.stands)
        if compared is not None:
            self._more_noise.after(compared)
            self._tell(WIRING, self._more_noise.stands, t_s, compared, _noise_words)

    def add_cold(self, share: float) -> None:
        """Note that cold water may have come in, as a `share` of what was there."""
        self._diluted /= 1.0 + share

    def take_gain(self, t_s: float, gain: Uncertain) -> Compared | None:
        """Take the gain of a move; return the comparison if it changed what stands."""
        if self._first is None:
            self._first = gain
            return None
        compared = Compared(_rough(self._first), _rough(gain))
        least = Compared(compared.before.scaled(self._diluted), compared.now)
        changed = self._water.after(compared)
        changed = self._element.after(least) or changed
        self._tell(WATER, self._water.stands, t_s, compared, _water_words)
        self._tell(ELEMENT, self._element.stands, t_s, compared, _element_words)
        if self._element.stands:
            self._active.pop(LOSS, None)
        return compared if changed else None

    # -- what is told ----------------------------------------------------------------------------

    def _tell(self, name: str, stands: bool, t_s: float, compared: Compared, words: Words) -> None:
        if not stands:
            self._active.pop(name, None)
            return
        before = self._active.get(name)
        since_s = t_s if before is None else before.since_s
        self._active[name] = Drift(
            name,
            since_s,
            words(compared),
            compared.before.mean,
            compared.now.mean,
            compared.sigmas,
        )


def _rough(gain: Uncertain) -> Uncertain:
    return Uncertain(gain.mean, math.hypot(gain.sd, UNLIKE * gain.mean / math.sqrt(2.0)))


def _percent(share: float) -> str:
    return f"{plain(abs(100.0 * share))} %"


def _loss_words(compared: Compared) -> str:
    before, now = 100.0 * compared.before.mean, 100.0 * compared.now.mean
    return (
        f"{_percent(compared.share)} more power to hold, {plain(now, 1)} % after "
        f"{plain(before, 1)} %: lid off, or a draught; or the element is weak"
    )


def _noise_words(compared: Compared) -> str:
    before, now = 1e3 * compared.before.mean, 1e3 * compared.now.mean
    return f"noise {plain(now)} mK after {plain(before)} mK: the wiring is noisy"


def _water_words(compared: Compared) -> str:
    left = _percent(compared.before.mean / compared.now.mean)
    return f"gain up {_percent(compared.share)}: the water is low, about {left} of it left"


def _element_words(compared: Compared) -> str:
    return f"gain down {_percent(compared.share)}: the element is weak, or the mains are low"
