"""The bank of corrected Kalman filters: a reading goes in, a belief comes out.

Nothing is changed in place once it is part of a belief, and what belongs to one is read-only. So a
belief may be kept, compared, gone back to, and carried on twice, as any other value.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from thermoctl.control.adaptive import evidence, filters, path
from thermoctl.control.adaptive.bank_belief import Ahead, BankBelief, Met, Twin
from thermoctl.control.adaptive.coasting import outlook
from thermoctl.control.adaptive.constants import Hearing, Lags, Plants
from thermoctl.control.adaptive.evidence import (
    EVIDENCE_FROM,
    GATE_SAMPLES,
    QUIET_SAMPLES,
    UNHEARD,
    Drifting,
    Excitation,
    Gate,
    Noise,
    Weights,
)
from thermoctl.control.adaptive.filters import T, X, Z
from thermoctl.control.adaptive.gains import Gains, reckoned
from thermoctl.control.adaptive.hypotheses import Hypotheses
from thermoctl.control.adaptive.path import Path
from thermoctl.quantities import Array, clamp, is_finite_number

LOSS_FROM_S = 60.0
"""The loss is limited by the gain from then on: before, the gain is hardly known."""
BLIND_S = 300.0
"""Without a reading for so long the filters stand still: what they would go on adding up says
nothing of the water any more. Gain, loss and weights are kept, water and sensor begin anew."""
ONSET_SAMPLES = 10
"""So many samples at least have to tell whether the plant was met at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """The law of the bank.

    Parameters
    ----------
    period_s : float
        Time from one sample to the next, .05 to 3,600 s.
    u_min, u_max : float
        Least and most power: at most 0, and above it.
    lags, plants, hearing : Lags, Plants, Hearing
        The constants of hypotheses, filters and evidence.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    period_s: float = 1.0
    u_min: float = 0.0
    u_max: float = 1.0
    lags: Lags = field(default_factory=Lags)
    plants: Plants = field(default_factory=Plants)
    hearing: Hearing = field(default_factory=Hearing)
    hypotheses: Hypotheses = field(init=False, repr=False)
    constants: filters.PerPeriod = field(init=False, repr=False)
    _arrivals: Mapping[int, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("u_min", "u_max"):
            if not is_finite_number(getattr(self, name)):
                raise ValueError(f"{name} must be a finite number, got {getattr(self, name)!r}")
        if self.u_min > 0.0:
            raise ValueError(f"u_min must be at most 0, got {self.u_min!r}")
        if self.u_max <= 0.0:
            raise ValueError(f"u_max must be positive, got {self.u_max!r}")
        hypotheses = Hypotheses.at_period(self.period_s, self.lags)
        constants = filters.per_period(hypotheses, self.plants, *self.bounds)
        object.__setattr__(self, "hypotheses", hypotheses)
        object.__setattr__(self, "constants", constants)
        object.__setattr__(self, "_arrivals", _arrivals(hypotheses, self.plants))

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and most power."""
        return self.u_min, self.u_max

    def start(
        self,
        prior: filters.Prior = filters.UNKNOWN,
        noise: Noise = UNHEARD,
        weights: Weights | None = None,
    ) -> BankBelief:
        """Return the belief before the first sample; power may have been full before.

        Parameters
        ----------
        prior, noise, weights : Prior, Noise, Weights
            What is known from elsewhere.
        """
        begun = BankBelief(
            -1,
            0,
            Excitation(),
            path.at_rest(self.hypotheses),
            noise,
            Gate(),
            evidence.equal(self.hypotheses) if weights is None else weights,
            Drifting(),
            prior=prior,
        )
        heated = begun._replace(
            excitation=Excitation(self.u_max), path=path.at_rest(self.hypotheses, self.u_max)
        )
        return begun._replace(twin=Twin(heated, 0.0, True, begun.weights, begun.weights))

    def observe(self, belief: BankBelief, y_c: float, applied: float) -> BankBelief:
        """Return the belief after a period of `applied` and the reading `y_c`.

        Parameters
        ----------
        belief : BankBelief
            The one before.
        y_c : float
            Reading in degC; NaN when there is none.
        applied : float
            Power that the plant really got; limited to the bounds.

        Raises
        ------
        ArithmeticError
            The result would not be finite; `belief` is still good.
        """
        return self.met(belief, self.ahead(belief, applied), y_c)

    def ahead(self, belief: BankBelief, applied: float) -> Ahead:
        """Return what a period of `applied` makes of `belief`, whatever will be read."""
        power = clamp(applied, self.u_min, self.u_max)
        way = path.pushed(belief.path, self.hypotheses, power)
        outlook, block = belief.outlook, belief.block
        if outlook is None:
            memory_s = unrest = 0.0
        else:
            # Rates are averaged: with a short lag as likely as a long one it is a short time.
            memory_s = self.hearing.memory_lags * outlook.lag_harmonic_s
            unrest = abs(power - outlook.holding_power)
        excitation = belief.excitation.after(power, self.period_s, memory_s, self.hearing)
        gains = None
        if block is None or belief.blind * self.period_s > BLIND_S:
            block = None
        elif (gains := self._kept(belief, excitation, unrest)) is None:
            block = self._predicted(block, way, belief.sample + 1, unrest)
        else:
            block = filters.moved(block, way.mean, self.constants)
        twin = None if belief.twin is None else self.ahead(belief.twin.belief, applied)
        return Ahead(excitation, way, unrest, block, gains, twin)

    def _kept(self, belief: BankBelief, excitation: Excitation, unrest: float) -> Gains | None:
        """Return the gains if they can be kept for one more sample; None if they cannot."""
        gains = belief.gains
        if gains is None or not gains.lasting or not self._still(excitation.share, unrest):
            return None
        return None if belief.sample + 1 in self._arrivals else gains

    def _still(self, share: float, unrest: float) -> bool:
        """Return whether the power is steady, and about what holds the water."""
        return share == 0.0 and unrest < self.hearing.quiet_power

    def met(self, belief: BankBelief, ahead: Ahead, y_c: float) -> BankBelief:
        """Return the belief after the reading `y_c` at the end of the period `ahead`.

        Raises
        ------
        ArithmeticError
            The result would not be finite; `belief` is still good.
        """
        after = self._met(belief, ahead, y_c)
        return after if belief.twin is None else self._led(belief, ahead, after, y_c)

    def foretold(self, belief: BankBelief, ahead: Ahead, y_c: float) -> float:
        """Return the log likelihood of `y_c`; of twins that of both, as far as likely."""
        alone, twin = self._foretold(belief, ahead, y_c, belief.weights)[0], belief.twin
        if twin is None or ahead.twin is None:
            return alone
        other = self._foretold(twin.belief, ahead.twin, y_c, twin.belief.weights)[0]
        odds = twin.odds - self.hearing.onset_odds
        share = 0.5 * (1.0 + math.tanh(0.5 * (odds if twin.heated else -odds)))
        most = max(alone, other)
        both = (1.0 - share) * math.exp(alone - most) + share * math.exp(other - most)
        return most + math.log(both)

    def _foretold(
        self, belief: BankBelief, ahead: Ahead, y_c: float, weights: Weights
    ) -> tuple[float, Weights]:
        r"""Return the log likelihood of `y_c`, and what it leaves of the weights.

        It is that of the hypotheses together, with these weights and without a constant:
        :math:`\ln \sum_j w_j \, S_j^{-1/2} e^{-\min(\nu_j^2/S_j,\,25)/2}`. Where nothing was
        foreseen, or `y_c` is NaN, it is 0.
        """
        block = ahead.block
        if block is None or not math.isfinite(y_c):
            return 0.0, weights
        nu = y_c - block[Z, X]
        S = block[Z, Z] + belief.noise.believed if ahead.gains is None else ahead.gains.S
        nis = np.minimum(nu * nu / S, self.hearing.gate_sds**2)
        log = weights.log - 0.5 * (np.log(S) + nis)
        most = float(log.max())
        told = most + math.log(float(np.exp(log - most).sum() * weights.share.max()))
        return told, weights.after(1.0, nis, S)

    def _led(self, belief: BankBelief, ahead: Ahead, after: BankBelief, y_c: float) -> BankBelief:
        """Return `after` or its twin, whichever leads, and for some time the other with it."""
        twin, hearing = belief.twin, self.hearing
        assert twin is not None
        assert ahead.twin is not None
        other = self._met(twin.belief, ahead.twin, y_c)
        alone, weights = self._foretold(belief, ahead, y_c, twin.beside)
        told, others = self._foretold(twin.belief, ahead.twin, y_c, twin.weights)
        for_heat = told - alone if twin.heated else alone - told
        odds = twin.odds + clamp(for_heat, -hearing.onset_most, hearing.onset_most)
        heat_leads = odds > hearing.onset_odds
        if heat_leads == twin.heated:
            after, other, weights, others = other, after, others, weights
        n = after.sample
        if n >= ONSET_SAMPLES and n * self.period_s >= hearing.onset_s:
            return after._replace(twin=None)
        return after._replace(twin=Twin(other, odds, not heat_leads, others, weights))

    def _met(self, belief: BankBelief, ahead: Ahead, y_c: float) -> BankBelief:
        """Return the belief after `y_c`, without a twin."""
        seen, way = math.isfinite(y_c), ahead.path
        if belief.block is None and not seen:
            return belief._replace(path=way, excitation=ahead.excitation)
        met = self._seen(belief, ahead, y_c) if seen else self._unseen(belief, ahead)
        gains, weights = met.gains, met.weights
        same = gains is not None and gains.age > 0 and weights is belief.weights
        before = belief.outlook if same else None
        view = outlook(met.block, way, weights.share, self.hypotheses, self.constants, before)
        if not math.isfinite(np.vdot(met.block, met.block) + view.coasting_c):
            raise ArithmeticError(f"expected a finite belief after {y_c!r} degC")
        for array in (met.block, *way):
            array.setflags(write=False)
        blind = 0 if seen else belief.blind + 1
        return BankBelief(belief.sample + 1, blind, ahead.excitation, way, *met, view)

    def lost(self, belief: BankBelief) -> BankBelief:
        """Return the belief after a gap of which the applied power is not known."""
        blind = max(belief.blind, math.ceil(BLIND_S / self.period_s)) + 1
        way = path.at_rest(self.hypotheses)
        return belief._replace(blind=blind, gate=Gate(), path=way, gains=None, twin=None)

    def _predicted(
        self, block: filters.Block, way: Path, sample: int, unrest: float
    ) -> filters.Block:
        """Return the block predicted for `sample`."""
        block = filters.predicted(block, way.mean, self.constants, unrest)
        arrived = self._arrivals.get(sample)
        if arrived is not None:
            filters.loosened(block, way.heat, arrived)
        return block

    def _begun(self, belief: BankBelief, ahead: Ahead, y_c: float) -> filters.Block:
        """Return the block where nothing was foreseen: the first, or the first after a gap."""
        if belief.block is None:
            block = filters.start(self.hypotheses, y_c, belief.prior, ahead.path.heat)
        else:
            block = filters.restarted(belief.block, self.hypotheses, y_c)
        return self._predicted(block, ahead.path, belief.sample + 1, ahead.unrest)

    def _misled(self, belief: BankBelief, block: filters.Block | None, y_c: float) -> bool:
        """Return whether the first reading was wrong, as the second one, `y_c`, is far from it.

        Nothing was there to hold the first against, and what it is missed by would pass for gain.
        Once is enough: a plant that does move as fast goes on from the second reading.
        """
        if block is None or belief.sample != belief.blind:
            return False
        m = belief.weights.likeliest
        nu, S_m = y_c - float(block[Z, X, m]), float(block[Z, Z, m]) + belief.noise.believed
        return nu * nu > self.hearing.gate_sds**2 * S_m

    def _unseen(self, belief: BankBelief, ahead: Ahead) -> Met:
        """Return what becomes of the prediction without a reading: for some time, the belief."""
        _, blind, _, _, noise, gate, weights, drifting, *_ = belief
        stands = (blind + 1) * self.period_s > BLIND_S
        block = belief.block if stands or ahead.block is None else ahead.block
        assert block is not None
        return Met(noise, gate, weights, drifting, 0.0, math.nan, block)

    def _seen(self, belief: BankBelief, ahead: Ahead, y_c: float) -> Met:
        """Return what becomes of the prediction when the reading `y_c` meets it."""
        sample, share, hearing = belief.sample + 1, ahead.excitation.share, self.hearing
        drifting, block, m = belief.drifting, ahead.block, belief.weights.likeliest
        nu = math.nan if block is None else y_c - block.item(Z, X, m)
        noise, weights = self._noise(belief, nu, y_c)
        if belief.noise.samples == 1 and self._misled(belief, block, y_c):
            belief, noise, block = belief._replace(block=None), Noise().after(y_c), None
        if block is None:
            block, surprise_k = self._begun(belief, ahead, y_c), math.nan
            nu = y_c - block.item(Z, X, m)
        else:
            surprise_k = y_c - float(belief.weights.share.dot(block[Z, X]))
        gains, still = ahead.gains, self._still(share, ahead.unrest)
        S_m = block.item(Z, Z, m) + noise.believed if gains is None else gains.S.item(m)
        lag = self.hypotheses.lag_s.item(m) / self.period_s
        gate = self._gated(belief, nu, S_m, hearing.hold_lags * lag)
        if gate.outlier:
            return Met(noise, gate, weights, drifting, 0.0, surprise_k, block)
        if sample >= drifting.silent_until:
            rest = max(hearing.quiet_lags * lag, QUIET_SAMPLES)
            drifting = drifting.after(still, nu / math.sqrt(S_m), rest, hearing)
        if gate.jumped or drifting.found:
            R, gains = noise.believed, None
            block, drifting = self._disturbed(block, gate, nu, R, sample, lag)
        if gains is not None:
            block = filters.followed(block, y_c, gains.K)
            filters.project(block, self.constants, loss=sample * self.period_s > LOSS_FROM_S)
            return Met(noise, gate, weights, drifting, 0.0, surprise_k, block, gains.older())
        silent_until = max(EVIDENCE_FROM, gate.silent_until, drifting.silent_until)
        heard, before = 0.0, block
        block, nis, S = filters.corrected(before, y_c, noise.believed, self.constants, share)
        if sample < gate.silent_until:  # what was poured in is colder, and loses less
            filters.grown(block, block[T, X] - before[T, X], self.constants)
        filters.project(block, self.constants, loss=sample * self.period_s > LOSS_FROM_S)
        if still and sample >= silent_until and not drifting.disturbed:
            K = filters.gains_at_rest(before, S, self.constants)
            gains = reckoned(belief.gains, K, S, m)
        elif sample >= silent_until and belief.gains is not None:
            gains = belief.gains.older()  # power that moved has left them what they were
        if share > 0.0 and sample >= silent_until and not (noise.stands or drifting.suspected):
            heard = share * noise.colour.news
            weights = weights.after(heard, nis, S)
        elif sample < gate.silent_until and not gate.jumped:
            weights = weights.among_shapes(nis, S)
        return Met(noise, gate, weights, drifting, heard, surprise_k, block, gains)

    def _disturbed(
        self, block: filters.Block, gate: Gate, nu: float, R: float, sample: int, lag: float
    ) -> tuple[filters.Block, Drifting]:
        """Return the block, and how it is heard, of water that has jumped or that drifts."""
        if gate.jumped:
            block, silent_until = filters.inflated(block, nu, R), gate.silent_until
        else:
            block = filters.reopened(block, self.plants)
            silent_until = sample + self.hearing.hold_lags * lag
        return block, Drifting(silent_until=silent_until, disturbed=True)

    def _gated(self, belief: BankBelief, nu: float, S_m: float, hold: float) -> Gate:
        """Return the gate after a reading that the likeliest missed by `nu`."""
        if belief.noise.samples >= GATE_SAMPLES and nu * nu > self.hearing.gate_sds**2 * S_m:
            return belief.gate.beyond(belief.sample + 1, hold)
        return belief.gate.within()

    def _noise(self, belief: BankBelief, nu: float, y_c: float) -> tuple[Noise, Weights]:
        """Return the noise after `y_c`, which the likeliest missed by `nu`, and the weights.

        Where what is not white makes it larger than it was ever taken for, all evidence was too
        strong by the same factor. Not at a jump, after which no lag gains or loses anything.
        """
        before, sample = belief.noise, belief.sample + 1
        if sample * self.period_s < self.hearing.onset_s:
            nu = math.nan  # it may be heat from before the first reading
        noise = before.after(y_c, nu, self.hearing)
        most = before.colour.most
        if noise.colour.most == most:
            return noise, belief.weights
        if sample < belief.gate.silent_until:
            return noise._replace(colour=noise.colour._replace(most=most)), belief.weights
        return noise, belief.weights.tempered(most / noise.colour.most)


def _arrivals(hypotheses: Hypotheses, plants: Plants) -> Mapping[int, Array]:
    """Return, by sample, how much is loosened where the heat has just arrived."""
    lags = hypotheses.lag_s / hypotheses.period_s
    samples = np.floor(plants.loosened_lags * lags) + 1.0
    return {
        int(sample): plants.loosened_share * (samples == sample) for sample in np.unique(samples)
    }
