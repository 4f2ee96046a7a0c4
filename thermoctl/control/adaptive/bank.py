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

from thermoctl.control.adaptive import evidence, filters, likelihood, path, twins
from thermoctl.control.adaptive.bank_belief import BankBelief, Correction, Prediction, Twin
from thermoctl.control.adaptive.coasting import outlook, renewed
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
from thermoctl.control.adaptive.filters import D, T, X, Z
from thermoctl.control.adaptive.gains import Corrected, Gains, reckoned
from thermoctl.control.adaptive.hypotheses import Hypotheses
from thermoctl.control.adaptive.path import Path
from thermoctl.quantities import Array, clamp, frozen, is_finite_number

LOSS_FROM_S = 60.0
"""Time in s from which on the gain limits the loss; before, the gain is hardly known."""
BLIND_S = 300.0
"""Time in s without a reading after which the filters stand still. Gain, loss and weights are kept;
water and sensor begin anew."""


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
        object.__setattr__(self, "_arrivals", filters.arrivals(hypotheses, self.plants))

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

    def under(self, belief: BankBelief, power: float) -> BankBelief:
        """Return the `belief` to begin with of a plant that has long had `power`."""
        power = clamp(power, self.u_min, self.u_max)
        way = path.at_rest(self.hypotheses, power)
        return belief._replace(excitation=Excitation(power), path=way, twin=None)

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
        return self.correct(belief, self.predict(belief, applied), y_c)

    def predict(self, belief: BankBelief, applied: float) -> Prediction:
        """Return the time update: what a period of `applied` makes of `belief`."""
        power = clamp(applied, self.u_min, self.u_max)
        way = path.pushed(belief.path, self.hypotheses, power)
        outlook, full, x = belief.outlook, belief.full, belief.x
        if outlook is None:
            memory_s = unrest = 0.0
        else:
            # Rates are averaged: with a short lag as likely as a long one it is a short time.
            memory_s = self.hearing.memory_lags * outlook.lag_harmonic_s
            unrest = abs(power - outlook.holding_power)
        excitation = belief.excitation.after(power, self.period_s, memory_s, self.hearing)
        gains = None
        if full is None or x is None or belief.blind * self.period_s > BLIND_S:
            full = x = None
        elif (gains := self._kept(belief, excitation, unrest)) is None:
            full = self._predicted(filters.joined(full, x), way, belief, unrest)
            x = full[:, X]
        else:
            x = filters.moved(x, way.mean, self.hypotheses, self.constants, belief.noise.above_k)
        twin = None if belief.twin is None else self.predict(belief.twin.belief, applied)
        return Prediction(excitation, way, unrest, full, x, gains, twin)

    def _kept(self, belief: BankBelief, excitation: Excitation, unrest: float) -> Gains | None:
        """Return the gains if they can be kept for one more sample; None if they cannot."""
        gains = belief.gains
        if gains is None or not (gains.settled and gains.fresh):
            return None
        if not self._still(excitation.share, unrest):
            return None
        return None if belief.sample + 1 in self._arrivals else gains

    def _still(self, share: float, unrest: float) -> bool:
        """Return whether the power is steady, and about what holds the water."""
        return share == 0.0 and unrest < self.hearing.quiet_power

    def correct(self, belief: BankBelief, ahead: Prediction, y_c: float) -> BankBelief:
        """Return the measurement update, by the reading `y_c` at the end of `ahead`.

        Raises
        ------
        ArithmeticError
            The result would not be finite; `belief` is still good.
        """
        after = self._correct(belief, ahead, y_c)
        if belief.twin is None or ahead.twin is None:
            return after
        other = self._correct(belief.twin.belief, ahead.twin, y_c)
        return twins.led(belief, ahead, y_c, (after, other), self.hearing, self.period_s)

    def log_likelihood(self, belief: BankBelief, ahead: Prediction, y_c: float) -> float:
        """Return the log likelihood of `y_c`; of twins that of both, as far as likely."""
        if belief.twin is not None and ahead.twin is not None:
            return twins.log_likelihood(belief, ahead, y_c, self.hearing)
        return likelihood.of_reading(belief, ahead, y_c, belief.weights, self.hearing.gate_sds)[0]

    def _correct(self, belief: BankBelief, ahead: Prediction, y_c: float) -> BankBelief:
        """Return the belief after `y_c`, without a twin."""
        seen, way = math.isfinite(y_c), ahead.path
        if belief.full is None and not seen:
            return belief._replace(path=way, excitation=ahead.excitation)
        rested = self._rested(belief, ahead, y_c) if seen else None
        if rested is not None:
            return rested
        met = self._seen(belief, ahead, y_c) if seen else self._unseen(belief, ahead)
        block = filters.joined(met.full, met.x)
        view = outlook(block, way, met.weights.share, self.hypotheses, self.constants)
        if not math.isfinite(float(np.vdot(block, block)) + view.coasting_c):
            raise ArithmeticError(f"expected a finite belief after {y_c!r} degC")
        for array in (met.full, met.x, *way):
            frozen(array)
        blind = 0 if seen else belief.blind + 1
        return BankBelief(belief.sample + 1, blind, ahead.excitation, way, *met, view)

    def _rested(self, belief: BankBelief, ahead: Prediction, y_c: float) -> BankBelief | None:
        """Return the belief after `y_c` by gains that are kept; None where it is no rest."""
        gains, full, x, before = ahead.gains, ahead.full, ahead.x, belief.outlook
        if gains is None or full is None or x is None or before is None:
            return None
        way, drifting, m = ahead.path, belief.drifting, belief.weights.likeliest
        nu, S_m = y_c - x.item(Z, m), gains.S.item(m)
        noise, weights = self._noise(belief, nu, y_c)
        gate = self._gated(belief, ahead, y_c, weights, noise.believed, nu * nu / S_m)
        if belief.sample + 1 >= drifting.silent_until:
            drifting = self._drifted(belief, True, nu / math.sqrt(S_m))
        if gate.outside or drifting.found:
            return None
        surprise_k = y_c - float(belief.weights.share.dot(x[Z]))
        x = filters.followed(x, y_c, gains.K, self.constants)
        always = way, weights.share, self.hypotheses, self.constants
        if weights is belief.weights:
            view = renewed(before, x, *always)
        else:
            view = outlook(filters.joined(full, x), *always)
        if not math.isfinite(surprise_k + view.coasting_c):  # of all that is new: no weight is 0
            raise ArithmeticError(f"expected a finite belief after {y_c!r} degC")
        for array in (x, *way):
            frozen(array)
        met = noise, gate, weights, drifting, 0.0, surprise_k, full, x, gains.older(kept=True)
        return BankBelief(belief.sample + 1, 0, ahead.excitation, way, *met, view)

    def lost(self, belief: BankBelief) -> BankBelief:
        """Return the belief after a gap of which the applied power is not known."""
        blind = max(belief.blind, math.ceil(BLIND_S / self.period_s)) + 1
        way = path.at_rest(self.hypotheses)
        return belief._replace(blind=blind, gate=Gate(), path=way, gains=None, twin=None)

    def _predicted(
        self, block: filters.Block, way: Path, belief: BankBelief, unrest: float
    ) -> filters.Block:
        """Return the block predicted for the sample after `belief`."""
        block = filters.predicted(block, way.mean, self.constants, unrest, belief.noise.above_k)
        arrived = self._arrivals.get(belief.sample + 1)
        if arrived is not None:
            filters.loosened(block, way.heat, arrived)
        return block

    def _begun(self, belief: BankBelief, ahead: Prediction, y_c: float) -> filters.Block:
        """Return the block where nothing was foreseen: the first, or the first after a gap."""
        if belief.block is None:
            block = filters.start(self.hypotheses, y_c, belief.prior, ahead.path.heat)
        else:
            block = filters.restarted(belief.block, self.hypotheses, y_c)
        return self._predicted(block, ahead.path, belief, ahead.unrest)

    def _unseen(self, belief: BankBelief, ahead: Prediction) -> Correction:
        """Return what becomes of the prediction without a reading: for some time, the belief."""
        _, blind, _, _, noise, gate, weights, drifting, *_ = belief
        stands = (blind + 1) * self.period_s > BLIND_S
        full, x = (belief.full, belief.x) if stands or ahead.x is None else (ahead.full, ahead.x)
        assert full is not None
        assert x is not None
        return Correction(noise, gate, weights, drifting, 0.0, math.nan, full, x)

    def _seen(self, belief: BankBelief, ahead: Prediction, y_c: float) -> Correction:
        """Return what becomes of the prediction when the reading `y_c` meets it."""
        sample, share, drifting = belief.sample + 1, ahead.excitation.share, belief.drifting
        block, x, gains, m = ahead.full, ahead.x, ahead.gains, belief.weights.likeliest
        nu = math.nan if x is None else y_c - x.item(Z, m)
        noise, weights = self._noise(belief, nu, y_c)
        first = belief.noise.samples == 1
        if first and likelihood.misled(belief, block, y_c, self.hearing.gate_sds):
            belief, noise, x = belief._replace(full=None), belief.noise.anew(y_c), None
        if block is None or x is None:
            block, surprise_k = self._begun(belief, ahead, y_c), math.nan
            x, nu = block[:, X], y_c - block.item(Z, X, m)
        else:
            surprise_k = y_c - float(belief.weights.share.dot(x[Z]))
        still = self._still(share, ahead.unrest)
        S_m = block.item(Z, Z, m) + noise.believed if gains is None else gains.S.item(m)
        gate = self._gated(belief, ahead, y_c, weights, noise.believed, nu * nu / S_m)
        if gate.outlier:
            return Correction(noise, gate, weights, drifting, 0.0, surprise_k, block, x)
        if sample >= drifting.silent_until:
            drifting = self._drifted(belief, still, nu / math.sqrt(S_m))
        if gate.jumped or drifting.found:
            block = filters.joined(block, x)
            block, drifting, gains = self._disturbed(belief, block, gate, nu, noise.believed)
        heard, before = self._heard(sample, share, noise, gate, drifting), block
        block, nis, S = filters.corrected(block, y_c, noise.believed, self.constants, share)
        if sample < gate.silent_until:  # what was poured in is colder, and loses less
            moved_k = block[T, X] - before[T, X]
            filters.grown(block[D, X], moved_k, self.constants, belief.noise.above_k)
        filters.limit_gain(block, self.constants)
        if sample * self.period_s > LOSS_FROM_S:
            filters.limit_loss(block, self.constants)
        gains = self._gains(belief, Corrected(before, block, S), drifting, still=still)
        if heard > 0.0:
            weights = weights.after(heard, nis, S)
        elif sample < gate.silent_until and not gate.jumped:
            weights = weights.among_shapes(nis, S)
        return Correction(
            noise, gate, weights, drifting, heard, surprise_k, block, block[:, X], gains
        )

    def _heard(
        self, sample: int, share: float, noise: Noise, gate: Gate, drifting: Drifting
    ) -> float:
        """Return what the sample counts as evidence for or against the hypotheses."""
        silent_until = max(EVIDENCE_FROM, gate.silent_until, drifting.silent_until)
        if sample < silent_until or noise.stands or drifting.suspected:
            return 0.0
        return share * noise.colour.news

    def _gains(
        self, belief: BankBelief, step: Corrected, drifting: Drifting, *, still: bool
    ) -> Gains | None:
        """Return the gains after a full `step`; power that moves for a moment leaves them alone."""
        if belief.sample + 1 < drifting.silent_until:
            return None
        gains = None if belief.gains is None else belief.gains.older(kept=False)
        if not still or drifting.disturbed or (gains is not None and gains.fresh):
            return gains
        return reckoned(gains, step, belief.full, belief.weights, self.constants)

    def _drifted(self, belief: BankBelief, still: bool, sds: float) -> Drifting:
        """Return the sums after an innovation of `sds` standard deviations."""
        rest = self.hearing.quiet_lags * self._lag(belief)
        rest = QUIET_SAMPLES if rest < QUIET_SAMPLES else rest
        return belief.drifting.after(still, sds, rest, self.hearing)

    def _disturbed(
        self, belief: BankBelief, block: filters.Block, gate: Gate, nu: float, R: float
    ) -> tuple[filters.Block, Drifting, None]:
        """Return the block of water that has jumped or drifts, how it is heard, and no gains."""
        if gate.jumped:
            block, silent_until = filters.inflated(block, nu, R), gate.silent_until
        else:
            block = filters.reopened(block, self.plants)
            silent_until = belief.sample + 1 + self.hearing.hold_lags * self._lag(belief)
        return block, Drifting(silent_until=silent_until, disturbed=True), None

    def _gated(
        self,
        belief: BankBelief,
        ahead: Prediction,
        y_c: float,
        weights: Weights,
        R: float,
        nis_m: float,
    ) -> Gate:
        """Return the gate after `y_c`, by which the likeliest is surprised by `nis_m`.

        Where one about as likely foresaw it the reading is no outlier, but tells them apart; not
        while a disturbance is learnt, when nothing does.
        """
        most, sample = self.hearing.gate_sds, belief.sample + 1
        if belief.noise.samples < GATE_SAMPLES or nis_m <= most**2:
            return belief.gate.within()
        settled = sample >= belief.drifting.silent_until
        if settled and likelihood.foreseen(weights, ahead, y_c, R, most):
            return belief.gate.within()
        return belief.gate.beyond(sample, self.hearing.hold_lags * self._lag(belief))

    def _lag(self, belief: BankBelief) -> float:
        """Return the lag of the likeliest hypothesis, in samples."""
        return self.hypotheses.lag_s.item(belief.weights.likeliest) / self.period_s

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
