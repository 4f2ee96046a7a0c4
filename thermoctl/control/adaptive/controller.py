"""The bank as a controller: a situation goes in, the power to ask for comes out.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, NamedTuple

from thermoctl.control.adaptive import held, trial
from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.bank_belief import BankBelief
from thermoctl.control.adaptive.coasting import Outlook, ahead, power_for
from thermoctl.control.adaptive.constants import Hearing, Lags, Pace, Plants
from thermoctl.control.adaptive.plant_belief import (
    gain,
    holding_power_sd,
    plant_belief,
)
from thermoctl.control.adaptive.remembered import recalled, remember
from thermoctl.control.adaptive.trial import Memory
from thermoctl.control.cooling import RATIO_MAX, RATIO_MIN, heat_of, power_for_heat
from thermoctl.control.inexact import EXACT, Inexact
from thermoctl.control.lasting import Lasting
from thermoctl.control.minimum_variance import HOLDING_SD_MAX, RIDE_MAX_S
from thermoctl.ports import Situation
from thermoctl.ranges import check_ranges, ranged
from thermoctl.signals import Beliefs, PlantBelief

RIDE_LAGS = 3.0
UNKNOWN_S, UNKNOWN_PERIODS = 60.0, 10.0
"""Gap in s, and in periods, beyond both of which nobody knows what was applied: commands expire."""

DOUBTFUL_LEAST, DOUBTFUL_MOST = 2.0, 0.9
"""The estimated gain counts as pinned to its lower bound below DOUBTFUL_LEAST times the least gain
(200 l at 33 W, or no heater), and to its upper bound above DOUBTFUL_MOST times the most heat under
way over the lag: power is then too strong an answer to any error."""

SDS_EVERY = 5
"""Number of samples after which standard deviations are computed anew; they change slowly."""


class Sds(NamedTuple):
    """Standard deviations: of the gain, in K/s, and of the holding power."""

    gain: float = math.nan
    holding_power: float = math.inf


class AdaptiveBelief(NamedTuple):
    """What the controller remembers.

    Parameters
    ----------
    bank : BankBelief
        After the last sample the bank has seen.
    behind_s : float
        Time by which the bank is behind, within half a period; ahead where negative.
    since_s, given_s : float
        Time since its last sample, and the applied power integrated over it.
    doubt : Lasting
        Whether power seems to warm nothing.
    memory : Memory
        What has become of a model that was remembered from an earlier run.
    sds : Sds
        How well gain and holding power were known, at most `SDS_EVERY` samples ago.
    surprise_k : float
        This reading less what was expected of it; NaN: not known, or not of one period.
    inexact : Inexact
        By how much the output is off its commands.
    """

    bank: BankBelief
    behind_s: float = 0.0
    since_s: float = 0.0
    given_s: float = 0.0
    doubt: Lasting = Lasting()
    memory: Memory = Memory()
    sds: Sds = Sds()
    surprise_k: float = math.nan
    inexact: Inexact = EXACT


@dataclass(frozen=True, slots=True)
class Adaptive:
    r"""Learn any plant with a bank of Kalman filters; nothing has to be tuned.

    96 hypotheses about lag and its shape each learn water temperature, loss and gain; they are
    weighted by how well they predicted. The power cancels the error of the temperature at which
    the water would come to rest, within :math:`T_c = \max(3\,\mathrm{s}, 1.5\,h, \kappa L)`, or up
    to three times that where full power does much in the time by which the lag may be mistaken.

    Parameters
    ----------
    calmness : float
        kappa, from 0.1 to 10: 0.2 is brisk, 0.8 calm. The one thing to choose.
    period_s : float
        Time between two samples, as the loop has it. Longer and shorter intervals are met by as
        many predictions as periods went by.
    action : {'heat', 'cool', 'heat-cool'}
        What power does to the plant; heat-cool: a positive one heats and a negative one cools.
    cooling_ratio : float
        For heat-cool: what the cooler takes out at full power over what the heater brings in, from
        0.02 to 10. Where it is not known, rather too low than too high.
    lags, plants, hearing, pace : Lags, Plants, Hearing, Pace
        The constants of the law. No plant met so far wanted others.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    calmness: float = ranged(0.35, 0.1, 10.0)
    period_s: float = 1.0
    action: Literal["heat", "cool", "heat-cool"] = "heat"
    cooling_ratio: float = ranged(0.2, RATIO_MIN, RATIO_MAX)
    lags: Lags = field(default_factory=Lags)
    plants: Plants = field(default_factory=Plants)
    hearing: Hearing = field(default_factory=Hearing)
    pace: Pace = field(default_factory=Pace)
    bank: Bank = field(init=False, repr=False, compare=False)
    _sign: float = field(init=False, repr=False, compare=False)
    """+1 or -1: to a lone cooler everything looks upside down, but for its power."""

    name: ClassVar[str] = "adaptive"

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.action not in ("heat", "cool", "heat-cool"):
            raise ValueError(f"action must be 'heat', 'cool' or 'heat-cool', got {self.action!r}")
        u_min = -self.cooling_ratio if self.action == "heat-cool" else 0.0
        bank = Bank(self.period_s, u_min, 1.0, self.lags, self.plants, self.hearing)
        object.__setattr__(self, "bank", bank)
        object.__setattr__(self, "_sign", -1.0 if self.action == "cool" else 1.0)

    def start(self) -> AdaptiveBelief:
        """Return the belief before the first sample: nothing is known."""
        return AdaptiveBelief(self.bank.start())

    def start_from(self, remembered: Mapping[str, Any], age_s: float) -> AdaptiveBelief:
        """Return the belief before the first sample, a remembered model on trial.

        Raises
        ------
        ValueError
            It was learnt with another bank, period or action, or no plant could be like that.
        """
        if remembered.get("action") != self.action:
            raise ValueError(f"expected action {self.action!r}, got {remembered.get('action')!r}")
        bank = recalled(self.bank, remembered, age_s)
        rival = self.bank.start(noise=bank.noise)
        steers, beside = held.begun(self.bank, bank)
        return AdaptiveBelief(steers, memory=Memory(rival, beside))

    def under(self, belief: AdaptiveBelief, power: float) -> AdaptiveBelief:
        """Return the `belief` to begin with of a plant that has long had `power`."""
        law, heat, rival = self.bank, heat_of(power, self.cooling_ratio), belief.memory.rival
        if rival is not None:
            rival = law.under(rival, heat)
        memory = replace(belief.memory, rival=rival, held=None)
        return belief._replace(bank=law.under(belief.bank, heat), memory=memory)

    def remember(self, belief: AdaptiveBelief) -> Mapping[str, Any] | None:
        """Return gain, loss, noise, weights, coldest; None until known, or on trial."""
        if belief.memory.rival is not None or belief.doubt.stands:
            return None
        kept = remember(self.bank, belief.bank)
        return None if kept is None else {"action": self.action, **kept}

    def origin(self, belief: AdaptiveBelief) -> str:
        """Return what the bank that steers began with."""
        return belief.memory.origin

    def observe(self, belief: AdaptiveBelief, situation: Situation) -> AdaptiveBelief:
        """Return the belief after this sample, whoever steers."""
        h, interval_s = self.period_s, situation.interval_s
        behind_s, since_s = belief.behind_s + interval_s, belief.since_s + interval_s
        applied = heat_of(situation.applied, self.cooling_ratio)
        inexact = belief.inexact.after(situation)
        given_s = belief.given_s + applied * interval_s
        bank, memory, gathered = belief.bank, belief.memory, belief.since_s > 0.0
        power = given_s / since_s if gathered else applied
        if interval_s > UNKNOWN_S and interval_s > UNKNOWN_PERIODS * h:
            bank, memory = trial.lost(self.bank, bank, memory)
            behind_s, power, gathered = h, 0.0, True
        periods = math.floor(behind_s / h + 0.5)
        if periods < 1:
            return AdaptiveBelief(
                bank, behind_s, since_s, given_s, belief.doubt, memory, belief.sds, inexact=inexact
            )
        for _ in range(periods - 1):
            bank, memory = trial.observe(self.bank, bank, memory, math.nan, power)
        sign = self._sign
        bank, memory = trial.observe(self.bank, bank, memory, sign * situation.measured_c, power)
        doubt = belief.doubt.after(_doubt(bank.outlook, self.plants))
        sds = self._sds(bank, memory) if _due(bank) else belief.sds
        surprise_k = math.nan if gathered or periods > 1 else sign * bank.surprise_k
        behind_s -= periods * h
        return AdaptiveBelief(bank, behind_s, 0.0, 0.0, doubt, memory, sds, surprise_k, inexact)

    def _sds(self, bank: BankBelief, memory: Memory) -> Sds:
        """Return how well gain and holding power are known; on trial no better than when new."""
        gain_sd, rival = gain(self.bank, bank)[1], memory.rival
        if rival is not None and rival.full is not None:
            gain_sd = max(gain_sd, gain(self.bank, rival)[1])
        return Sds(gain_sd, holding_power_sd(bank))

    def decide(self, belief: AdaptiveBelief, situation: Situation) -> tuple[AdaptiveBelief, float]:
        """Return the power that lets the water come to rest at the set point."""
        outlook, setpoint_c = belief.bank.outlook, situation.setpoint_c
        if outlook is None or not math.isfinite(setpoint_c):
            return belief, math.nan
        before = belief.bank.path.powers.item(0)
        bounds, r_c, ramp_heat = self.bank.bounds, self._sign * setpoint_c, 0.0
        if situation.setpoint_rate_k_per_s != 0.0:
            rate = self._sign * situation.setpoint_rate_k_per_s
            end_c = self._sign * situation.target_c
            r_c, rate = ahead(r_c, rate, end_c, outlook.lag_s)
            ramp_heat = rate / outlook.gain
        heat = power_for(
            outlook,
            r_c,
            self.calmness,
            self.period_s,
            bounds,
            before,
            ramp_heat,
            self.pace,
            situation.kept_s,
        )
        return belief, belief.inexact.made_up_for(power_for_heat(heat, self.cooling_ratio))

    def surprise_k(self, belief: AdaptiveBelief, situation: Situation) -> float:
        """Return reading minus what the hypotheses expected; NaN beyond one period."""
        return belief.surprise_k

    def beliefs(self, belief: AdaptiveBelief, situation: Situation) -> Beliefs:
        """Return gain with its error, lag, and holding power once it is known to 0.05."""
        outlook, sds = belief.bank.outlook, belief.sds
        if outlook is None:
            return Beliefs()
        known = sds.holding_power <= HOLDING_SD_MAX
        holding_power = power_for_heat(outlook.holding_power, self.cooling_ratio) if known else None
        rate, lag_s = self._sign * outlook.gain, outlook.lag_s
        return Beliefs(rate, sds.gain, holding_power=holding_power, lag_s=lag_s)

    def plant(self, belief: AdaptiveBelief) -> PlantBelief | None:
        """Return everything believed of the plant; None before the first valid reading."""
        told = plant_belief(self.bank, belief.bank, self._sign)
        if told is None or not told.holding_power < 0.0:
            return told
        return replace(
            told,
            holding_power=power_for_heat(told.holding_power, self.cooling_ratio),
            holding_power_sd=told.holding_power_sd / self.cooling_ratio,
        )

    def ride_s(self, belief: AdaptiveBelief) -> float:
        """Return three lags, at most 60 s; 0 before the first valid reading."""
        outlook = belief.bank.outlook
        return 0.0 if outlook is None else min(RIDE_LAGS * outlook.lag_s, RIDE_MAX_S)

    def remarks(self, belief: AdaptiveBelief) -> Mapping[str, str]:
        """Return whether power warms nothing, and the verdict on what was remembered."""
        remarks, memory = {}, belief.memory
        if belief.doubt.stands:  # no heater, one wired to cool, or one stronger than any plant's
            remarks["controller.gain_doubtful"] = belief.doubt.text
        if memory.verdict:
            remarks[memory.verdict] = memory.text
        return remarks


def _due(bank: BankBelief) -> bool:
    """Return whether standard deviations have to be reckoned anew: where gains are, with them."""
    gains = bank.gains
    if gains is not None and gains.settled:
        return gains.age == 0
    return bank.full is not None and bank.sample % SDS_EVERY == 0


def _doubt(outlook: Outlook | None, plants: Plants) -> str:
    """Return what is doubtful of the gain, "" for nothing.

    Told that power cools, the filters rest on their lower bound. On the upper one rests a plant
    that is quicker than any they know; a gain that is not known yet says nothing of that.
    """
    if outlook is None:
        return ""
    gain, lag_s = outlook.gain, outlook.lag_s
    least = DOUBTFUL_LEAST * plants.gain_min_k_per_s
    if gain <= least:
        return f"expected more than {least:g} K/s at full power, learnt {gain:.2g}"
    most = DOUBTFUL_MOST * plants.heat_max_k / lag_s
    if gain < most or outlook.gain_sd > plants.known_share * gain:
        return ""
    return f"expected less than {most:.2g} K/s with a lag of {lag_s:.0f} s, learnt {gain:.2g}"
