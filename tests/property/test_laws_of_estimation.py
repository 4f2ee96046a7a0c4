"""One table of all estimators, and the laws that every one of them obeys.

A row says how a filter is built in a `World`: so many parameters, in such units. What is special to
one filter stands in ``tests/unit/estimation``; what holds for several is written once, here.
"""

import math
from collections.abc import Callable
from dataclasses import FrozenInstanceError, dataclass, replace
from functools import cache

import numpy as np
import pytest

from thermoctl.estimation import (
    CorrectedKalman,
    Estimate,
    Guarded,
    LainiotisBank,
    LinearModel,
    MatrixFading,
    MultipleFading,
    Order,
    RandomWalkKalman,
    RecursiveLeastSquares,
    StateKalman,
    VariableForgetting,
    run_batch,
    start,
)

R2, SIGMA0, DRIFT = 0.5, 5.0, 0.01
SIZES = (1, 2, 4)


@dataclass(frozen=True, eq=False)
class World:
    """Units to count in: ``y = unit * y0``, ``theta = unit * basis @ theta0``.

    `cap` is the largest variance that guards allow, in the original units.
    """

    n: int
    basis: np.ndarray | None = None
    unit: float = 1.0
    cap: float = 1e4

    @property
    def A(self):
        return np.eye(self.n) if self.basis is None else self.basis

    @property
    def scale(self):
        """Return by how much the basis stretches parameters."""
        return abs(float(np.linalg.det(self.A))) ** (1.0 / self.n)

    def parameters(self, theta):
        return self.unit * self.A @ theta

    def regressors(self, phi):
        return phi @ np.linalg.inv(self.A)

    def covariance(self, P, in_noise_units=False):
        """Return a covariance of parameters; least squares counts it in units of the noise."""
        return (1.0 if in_noise_units else self.unit**2) * self.A @ P @ self.A.T


class Recursive:
    """A law of the recursive kind, bare or guarded."""

    def __init__(self, law):
        self.law = law

    def start(self, P0, theta0):
        return start(len(theta0), P0, theta0)

    def update(self, belief, phi, y):
        return self.law.update(belief, phi, y)


@dataclass(frozen=True, slots=True, eq=False)
class Seen(Estimate):
    """What another kind of filter believes, looked at as an estimate."""

    within: object = None


class Walking:
    """A state-space law whose state walks at random and is observed through the regressor."""

    def __init__(self, build, Q, R):
        self.build, self.Q, self.R = build, Q, R

    def start(self, P0, theta0):
        n = len(theta0)
        law = self.build(LinearModel(np.eye(n), np.eye(n)[:1], self.Q, self.R))
        return Seen(np.array(theta0), P0, within=law.start(theta0, P0 - self.Q))

    def update(self, belief, phi, y):
        law = self.build(LinearModel(np.eye(len(phi)), [phi], self.Q, self.R))
        within = law.update(belief.within, y)
        if within.rejected:
            return replace(belief, rejected=True, within=within)
        S, e = within.innovation_cov.item(), within.innovation.item()
        P = within.P + self.Q  # P(t+1|t): a walk predicts when the next observation is there
        P.setflags(write=False)
        return Seen(within.x, P, e, S, 1.0, False, within)


class Alone:
    """A bank of one candidate without outputs; its regressors are a past of inputs."""

    def __init__(self, Q, R):
        self.Q, self.R = Q, R

    def start(self, P0, theta0):
        n = len(theta0)
        bank = LainiotisBank([Order(0, n)], R=self.R, P0=P0[0, 0], Q=self.Q)
        return Seen(np.zeros(n), P0, within=bank)

    def update(self, belief, phi, y):
        bank = belief.within.update(y, phi[0])
        if bank.rejected:
            return replace(belief, rejected=True, within=bank)
        S = float(phi @ belief.P @ phi) + self.R
        P = bank._belief.P[:, :, 0]
        return Seen(bank.theta, P, y - bank.prediction, S, 1.0, False, bank)


def anything(rng, n, T):
    return rng.normal(size=(T, n))


def one_at_a_time(rng, n, T):
    """Return regressors with one non-zero each, as the fading laws want them."""
    phi = np.zeros((T, n))
    phi[np.arange(T), rng.integers(n, size=T)] = rng.normal(size=T)
    return phi


def a_past(rng, n, T):
    """Return regressors that are the last n of a series of inputs, from rest."""
    u = np.concatenate((np.zeros(n - 1), rng.normal(size=T)))
    return np.array([u[t : t + n][::-1] for t in range(T)])


def no_drift(n):
    return np.zeros((n, n))


def even(n):
    return DRIFT * np.eye(n)


def correlated(n):
    return DRIFT * 0.5 ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))


RICCATI = (DRIFT + math.sqrt(DRIFT**2 + 4 * DRIFT * R2)) / 2


@dataclass(frozen=True, eq=False)
class Variant:
    """A row of the table: how a filter is built, and what may be asked of it.

    Variances are in original units. A law of the recursive kind without guards also stands in
    `law`, where a batch can take it.
    """

    name: str
    build: Callable[[World], object]
    law: Callable[[World], object] | None = None
    R1: Callable[[int], np.ndarray] = no_drift  # per sample, for n parameters
    noise: Callable[[Estimate], float] = lambda belief: R2  # with which the last sample counted
    in_noise_units: bool = False  # P, as least squares has it
    bases: frozenset = frozenset({"sign", "stretch", "permutation", "any"})  # that it can follow
    regressors: Callable = anything
    takes_any_phi: bool = True  # others take a regressor as a matrix of a model
    round_start: bool = False  # only P0 = 2 I and theta0 = 0
    inflates: bool = False
    fades: bool = False
    settled: float | None = None  # P under a constant regressor of 1 and no surprise

    def prior(self, rng, n):
        """Return a covariance and a guess to start from, in original units."""
        if self.round_start:
            return 2.0 * np.eye(n), np.zeros(n)
        root = rng.normal(size=(n, n))
        return root @ root.T + 0.2 * np.eye(n), rng.normal(size=n)

    def samples(self, rng, n, T):
        """Return regressors and outputs of a plant with constant parameters and noise R2."""
        phi = self.regressors(rng, n, T)
        return phi, phi @ rng.normal(size=n) + math.sqrt(R2) * rng.normal(size=T)


def bare():
    """Return the rows of the recursive laws, without guards."""

    def least(name, law, noise, settled):
        return Variant(
            name,
            lambda w, law=law: Recursive(law(w)),
            noise=noise,
            in_noise_units=True,
            law=law,
            settled=settled,
        )

    def kalman(name, law, R1=no_drift, **kept):
        def build(w, R1=R1):
            drift = 0.0 if R1 is no_drift else w.covariance(R1(w.n))
            if R1 is even and w.basis is None:
                drift = w.unit**2 * DRIFT  # a number where a number will do
            return law(R1=drift, R2=w.unit**2 * R2)

        settled = None if R1 is no_drift else RICCATI
        return Variant(
            name, lambda w: Recursive(build(w)), law=build, R1=R1, settled=settled, **kept
        )

    def at_most_threefold(**arguments):
        return CorrectedKalman(inflation_max=3.0, **arguments)

    return [
        least("rls 1", lambda w: RecursiveLeastSquares(), lambda b: 1.0, None),
        least("rls .95", lambda w: RecursiveLeastSquares(0.95), lambda b: 0.95, 0.05),
        least("vff", lambda w: VariableForgetting(w.unit**2 * SIGMA0), lambda b: 1.0, None),
        least(
            "vff joint",
            lambda w: VariableForgetting(w.unit**2 * SIGMA0, 0.3, joint=True),
            lambda b: 1.0 / b.inflation,
            None,
        ),
        kalman("nkf", RandomWalkKalman),
        kalman("nkf drifting", RandomWalkKalman, even),
        kalman("nkf drifting together", RandomWalkKalman, correlated),
        kalman("ckf", CorrectedKalman, inflates=True),
        kalman("ckf drifting", CorrectedKalman, correlated, inflates=True),
        kalman("ckf at most threefold", at_most_threefold, even, inflates=True),
    ]


def guarded(variant, **guards):
    """Return the row of a law with guards; they are given in original units."""

    def build(w):
        given = {"covariance_max": w.cap * w.scale**2, **guards}
        if not variant.in_noise_units:
            given["covariance_max"] *= w.unit**2
        if "excitation_min" in given:
            given["excitation_min"] /= w.scale
        return Recursive(Guarded(variant.law(w), **given))

    pauses, robust = "excitation_min" in guards, "robust_R2" in guards
    # The spread of a regressor is a length, which not every basis keeps.
    bases = variant.bases - {"any"} if pauses else variant.bases
    name = f"{variant.name} capped{', pausing' * pauses}{', robust' * robust}"
    noise = (lambda belief: belief.R2) if robust else variant.noise
    settled = None if pauses or robust else variant.settled
    return replace(
        variant, name=name, build=build, bases=bases, noise=noise, settled=settled, law=None
    )


def walking(name, law, R1, **kept):
    """Return the row of a state-space law."""

    def build(w):
        adapted = (lambda model: law(model, w)) if kept.get("fades") else law
        return Walking(adapted, w.covariance(R1(w.n)), w.unit**2 * R2)

    settled = None if R1 is no_drift else RICCATI
    return Variant(name, build, R1=R1, takes_any_phi=False, settled=settled, **kept)


def table():
    """Return all rows."""
    laws = bare()
    by_name = {variant.name: variant for variant in laws}
    for variant in list(laws):
        laws += [guarded(variant), guarded(variant, excitation_min=0.3)]
    for name in ("nkf drifting", "ckf", "ckf drifting"):
        laws += [
            guarded(by_name[name], robust_R2=True),
            guarded(by_name[name], excitation_min=0.3, robust_R2=True),
        ]
    sparse = {"regressors": one_at_a_time, "bases": frozenset({"sign", "stretch", "permutation"})}
    past = {
        "regressors": a_past,
        "bases": frozenset({"sign", "stretch"}),
        "round_start": True,
    }
    for R1, drifting in ((no_drift, ""), (even, " drifting")):
        laws += [
            walking(f"state{drifting}", StateKalman, R1),
            walking(f"calm filter 1{drifting}", calm_filter_1, R1, **sparse),
            walking(f"calm filter 2{drifting}", calm_filter_2, R1, **sparse),
            walking(f"filter 1{drifting}", filter_1, R1, fades=True, **sparse),
            walking(f"filter 2{drifting}", filter_2, R1, fades=True, **sparse),
            Variant(
                f"bank{drifting}",
                lambda w, R1=R1: Alone((w.unit * w.scale) ** 2 * R1(1)[0, 0], w.unit**2 * R2),
                R1=R1,
                **past,
            ),
        ]
    return laws


def calm_filter_1(model):
    return MultipleFading(model, confidence=1.0 - 1e-9)


def calm_filter_2(model):
    return MatrixFading(model, confidence=1.0 - 1e-9, s_min=1.0, s_max=1.0)


def filter_1(model, world):
    return MultipleFading(model)


def filter_2(model, world):
    return MatrixFading(model, delta=1e-4 * world.unit**4 * world.scale**2)


VARIANTS = table()


def every(*, where=lambda variant: True):
    """Run a test once for each row of the table that has a property."""
    chosen = [variant for variant in VARIANTS if where(variant)]
    assert chosen
    return pytest.mark.parametrize("variant", chosen, ids=lambda variant: variant.name)


def run(variant, world, phi, y, P0, theta0):
    """Return the beliefs in `world` after each sample given in original units; the first before."""
    law = variant.build(world)
    P = world.covariance(P0, variant.in_noise_units)
    beliefs = [law.start(P, world.parameters(theta0))]
    for regressor, output in zip(world.regressors(phi), world.unit * y, strict=True):
        beliefs.append(law.update(beliefs[-1], regressor, float(output)))
    return beliefs


@cache
def moment(variant, n, T=24):
    """Return regressors, outputs, P0 and theta0 for a row."""
    rng = np.random.default_rng(n)
    return *variant.samples(rng, n, T), *variant.prior(rng, n)


@cache
def beliefs_of(variant, n):
    """Return what it believes at its moment, in original units."""
    return run(variant, World(n), *moment(variant, n))


def close(a, b, digits=8):
    b = np.asarray(b)
    np.testing.assert_allclose(a, b, rtol=0.0, atol=10.0**-digits * (np.abs(b).max() + 1e-300))


@every(where=lambda v: not (v.R1(1).any() or v.fades))
def test_what_is_believed_is_the_batch_solution_with_the_weights_that_were_reported(variant):
    for n in SIZES:
        phi, y, P0, theta0 = moment(variant, n)
        information, vector = np.linalg.inv(P0), np.linalg.solve(P0, theta0)
        beliefs = beliefs_of(variant, n)
        for before, belief, regressor, output in zip(beliefs, beliefs[1:], phi, y, strict=False):
            if belief.theta is before.theta:  # a guard paused it
                continue
            weight = 1.0 / variant.noise(belief)
            information = (information + weight * np.outer(regressor, regressor)) / belief.inflation
            vector = (vector + weight * regressor * output) / belief.inflation
        close(beliefs[-1].theta, np.linalg.solve(information, vector))  # O21 (5)
        close(beliefs[-1].P, np.linalg.inv(information))  # O21 (9)


def expected_of_a_walk(phi, y, P0, theta0, R1):
    """Return mean and covariance of theta(T + 1), all samples taken at once."""
    T = len(y)
    steps = np.minimum.outer(np.arange(T), np.arange(T))
    weave = phi @ P0 @ phi.T + steps * (phi @ R1 @ phi.T) + R2 * np.eye(T)
    across = P0 @ phi.T + np.arange(T) * (R1 @ phi.T)
    gain = np.linalg.solve(weave, across.T).T
    return theta0 + gain @ (y - phi @ theta0), P0 + T * R1 - gain @ across.T


@every(where=lambda v: v.R1(1).any() and not (v.inflates or v.fades or "," in v.name))
def test_what_is_believed_of_a_walk_is_its_conditional_mean_given_all_samples(variant):
    for n in SIZES:
        phi, y, P0, theta0 = moment(variant, n)
        belief = beliefs_of(variant, n)[-1]
        theta, P = expected_of_a_walk(phi, y, P0, theta0, variant.R1(n))
        close(belief.theta, theta)
        close(belief.P, P)


@every(where=lambda v: v.settled is not None)
def test_covariance_settles_at_the_fixed_point_of_its_riccati_equation(variant):
    law = variant.build(World(1))
    belief = law.start(np.full((1, 1), 3.0), np.zeros(1))
    for _ in range(700 if variant.in_noise_units else 150):
        belief = law.update(belief, np.ones(1), 0.0)  # as expected: only the law itself moves P
    assert belief.P.item() == pytest.approx(variant.settled, rel=1e-12)


def basis_of(kind, rng, n):
    if kind == "sign":
        return -np.eye(n)
    if kind == "stretch":
        return 30.0 * np.eye(n)
    if kind == "permutation":
        return np.eye(n)[rng.permutation(n)] * rng.choice([-1.0, 1.0], size=n)
    return rng.normal(size=(n, n)) + 2.0 * np.eye(n)


@pytest.mark.parametrize(
    ("variant", "kind"),
    [
        pytest.param(variant, kind, id=f"{variant.name}-{kind}")
        for variant in VARIANTS
        for kind in sorted(variant.bases)
    ],
)
def test_another_basis_of_the_parameters_describes_the_same_belief(variant, kind):
    for n in SIZES:
        world = World(n, basis_of(kind, np.random.default_rng(n), n))
        here, there = beliefs_of(variant, n)[-1], run(variant, world, *moment(variant, n))[-1]
        close(there.theta, world.parameters(here.theta))
        close(there.P, world.covariance(here.P, variant.in_noise_units))
        assert there.innovation == pytest.approx(here.innovation, rel=1e-8)
        assert there.inflation == pytest.approx(here.inflation, rel=1e-8)


@every()
def test_another_unit_of_the_output_describes_the_same_belief(variant):
    for n, unit in zip(SIZES, (0.02, 300.0, 0.1), strict=True):
        world = World(n, unit=unit)
        here, there = beliefs_of(variant, n)[-1], run(variant, world, *moment(variant, n))[-1]
        close(there.theta, unit * here.theta)
        close(there.P, world.covariance(here.P, variant.in_noise_units))
        assert there.innovation == pytest.approx(unit * here.innovation, rel=1e-8)
        assert there.inflation == pytest.approx(here.inflation, rel=1e-8)


@every()
def test_turning_the_sign_of_the_output_turns_theta_and_no_bit_else(variant):
    for n in SIZES:
        there = run(variant, World(n, unit=-1.0), *moment(variant, n))[-1]
        here = beliefs_of(variant, n)[-1]
        assert np.array_equal(there.theta, -here.theta)
        assert np.array_equal(there.P, here.P)
        assert (there.innovation, there.inflation) == (-here.innovation, here.inflation)


@every()
def test_covariance_is_symmetric_to_the_last_bit_and_positive_definite_outliers_included(variant):
    for n in SIZES:
        phi, y, P0, theta0 = moment(variant, n, T=60)
        y = y.copy()
        y[[15, 35, 36]] += [1e2, -1e3, 1e4]
        for belief in run(variant, World(n), phi, y, P0, theta0)[1:]:
            assert np.array_equal(belief.P, belief.P.T)
            assert np.linalg.eigvalsh(belief.P)[0] > 0.0


@every()
def test_innovation_and_its_variance_are_those_before_the_update(variant):
    for n in SIZES:
        phi, y, *_ = moment(variant, n)
        beliefs = beliefs_of(variant, n)
        for before, belief, regressor, output in zip(beliefs, beliefs[1:], phi, y, strict=False):
            e, q = output - regressor @ before.theta, regressor @ before.P @ regressor
            assert belief.innovation == pytest.approx(e, rel=1e-9, abs=1e-12)
            if not (variant.fades or belief.theta is before.theta):  # faded S; paused
                S = q + variant.noise(belief)
                assert belief.innovation_var == pytest.approx(S, rel=1e-9)


BAD = [math.nan, math.inf, -math.inf, 1e140, 1e300]


@every()
def test_a_sample_that_is_not_finite_changes_nothing_but_the_mark_and_leaves_no_trace(variant):
    for n in (1, 3):
        phi, y, *_ = moment(variant, n)
        law, clean = variant.build(World(n)), beliefs_of(variant, n)
        for at, value in enumerate(BAD, start=len(phi) - 1 - len(BAD)):
            spoilt = phi[at].copy()
            spoilt[0] = value
            pairs = [(phi[at], value)]
            if variant.takes_any_phi:
                pairs += [(spoilt, 1.0), (np.full(n, value), value)]
            belief = clean[at]
            for regressor, output in pairs:
                belief = law.update(belief, regressor, output)
                assert belief.rejected
                for name in ("theta", "P", "innovation", "innovation_var", "inflation"):
                    assert np.array_equal(getattr(belief, name), getattr(clean[at], name))
            for regressor, output in zip(phi[at:], y[at:], strict=True):
                belief = law.update(belief, regressor, float(output))
            assert np.array_equal(belief.theta, clean[-1].theta)
            assert np.array_equal(belief.P, clean[-1].P)
            assert belief.rejected == clean[-1].rejected


@every()
def test_an_update_touches_nothing_and_its_arrays_are_read_only(variant):
    for n in (1, 3):
        phi = moment(variant, n)[0]
        law, belief = variant.build(World(n)), beliefs_of(variant, n)[-1]
        copies = belief.theta.copy(), belief.P.copy(), phi.copy()
        after = law.update(belief, phi[0], 3.0)
        for held, copy in zip((belief.theta, belief.P, phi), copies, strict=True):
            assert np.array_equal(held, copy)
        for array in (after.theta, after.P):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0
        with pytest.raises(FrozenInstanceError):
            after.rejected = True


@every(where=lambda v: v.law is not None)
def test_a_batch_is_the_loop_over_its_replications_gaps_included(variant):
    for n in SIZES:
        rng, law = np.random.default_rng(n), variant.law(World(n))
        phi, y = rng.normal(size=(30, 4, n)), rng.normal(size=(30, 4))
        y[7, 1], phi[11, 2, n - 1], y[0, 3] = math.nan, math.inf, 1e200
        phi[20, 0, 0], phi[25, 1] = math.nan, 1e60
        P0, theta0 = variant.prior(rng, n)
        batch = run_batch(law, y, phi, P0, theta0)
        for r in range(4):
            belief = start(n, P0, theta0)
            for t in range(30):
                belief = law.update(belief, phi[t, r], float(y[t, r]))
                for name in ("theta", "P", "innovation", "inflation"):
                    there = getattr(batch, name)[t, r]
                    np.testing.assert_allclose(there, getattr(belief, name), rtol=1e-12, atol=1e-12)


def assert_same_bits(here, there, n):
    """Assert that two laws agree to the last bit on any samples."""
    rng = np.random.default_rng(n)
    root = rng.normal(size=(n, n))
    ours = theirs = start(n, root @ root.T + np.eye(n), rng.normal(size=n))
    for _ in range(30):
        phi, y = rng.normal(size=n), 3.0 * rng.normal()
        ours, theirs = here.update(ours, phi, y), there.update(theirs, phi, y)
        assert np.array_equal(ours.theta, theirs.theta)
        assert np.array_equal(ours.P, theirs.P)
        for name in ("innovation", "innovation_var", "inflation", "rejected"):
            assert getattr(ours, name) == getattr(theirs, name)


LEAST_SQUARES = RecursiveLeastSquares()
ONE_FILTER = {
    "least squares": (LEAST_SQUARES, RandomWalkKalman(0.0, 1.0)),
    "nothing forgotten": (VariableForgetting(5.0, forgetting_min=1.0), LEAST_SQUARES),
    "nothing forgotten, joint": (VariableForgetting(5.0, 1.0, joint=True), LEAST_SQUARES),
    "nothing surprises": (CorrectedKalman(0.01, 1e9), RandomWalkKalman(0.01, 1e9)),
    "not to inflate": (CorrectedKalman(0.01, 0.5, 1.0), RandomWalkKalman(0.01, 0.5)),
}


@pytest.mark.parametrize(("here", "there"), ONE_FILTER.values(), ids=ONE_FILTER)
def test_laws_that_are_one_filter_agree_to_the_last_bit(here, there):
    for n in SIZES:
        assert_same_bits(here, there, n)


@every(where=lambda v: v.law is not None)
def test_a_guarded_law_without_guards_is_the_bare_one_to_the_last_bit(variant):
    for n in SIZES:
        assert_same_bits(Guarded(variant.law(World(n))), variant.law(World(n)), n)


@every(where=lambda v: not (v.law or v.fades or "capped" in v.name))
def test_a_model_that_walks_and_a_bank_of_one_are_the_normal_filter(variant):
    for n in SIZES:
        phi, y, P0, theta0 = moment(variant, n)
        there = start(n, P0, theta0)
        law = RandomWalkKalman(variant.R1(n), R2)
        for here, regressor, output in zip(beliefs_of(variant, n)[1:], phi, y, strict=True):
            there = law.update(there, regressor, output)
            close(here.theta, there.theta, digits=11)
            close(here.P, there.P, digits=11)
            assert here.innovation == pytest.approx(there.innovation, rel=1e-9)


@every(where=lambda v: v.inflates and v.law)
def test_the_correction_is_the_long_ratio_as_printed(variant):
    fired = 0
    for n in SIZES:
        phi, y, *_ = moment(variant, n)
        limit = variant.law(World(n)).inflation_max
        for before, after, regressor, output in zip(
            beliefs_of(variant, n), beliefs_of(variant, n)[1:], phi, y, strict=False
        ):
            moved, left = after.theta - before.theta, output - regressor @ after.theta
            ratio = (moved @ np.linalg.solve(before.P, moved) + left**2 / R2) / (n + 1)  # O21 (26)
            assert after.inflation == pytest.approx(min(max(1.0, ratio), limit), rel=1e-9)
            fired += ratio > 1.0
    assert fired


def test_several_observations_at_once_are_as_many_one_after_another():
    rng = np.random.default_rng(3)
    for n, m in ((2, 2), (3, 2), (4, 3)):
        H, R = rng.normal(size=(m, n)), rng.uniform(0.1, 2.0, size=m)
        law = StateKalman(LinearModel(np.eye(n), H, correlated(n), np.diag(R)))
        belief = law.start(np.zeros(n), 2.0)
        there = start(n, belief.P + correlated(n))
        for _ in range(20):
            z = rng.normal(size=m)
            belief = law.update(belief, z)
            for r in range(m):
                law_of_one = RandomWalkKalman(correlated(n) if r == m - 1 else 0.0, float(R[r]))
                there = law_of_one.update(there, H[r], float(z[r]))
            close(belief.x, there.theta, digits=11)
            close(belief.P + correlated(n), there.P, digits=11)


def rest(variant, samples):
    """Yield what is believed of a loop at its set point: one regressor, noise as expected."""
    world = World(3, cap=2.0)
    law, rng = variant.build(world), np.random.default_rng(4)
    belief = law.start(2.0 * np.eye(3), np.zeros(3))
    phi, noise = np.array([1.0, 0.25, -0.5]), math.sqrt(R2) * rng.normal(size=samples)
    for t in range(samples):
        belief = law.update(belief, phi, 1.0 + float(noise[t]))
        if t % 97 == 0:
            yield belief
    yield belief


def assert_sound(beliefs):
    for belief in beliefs:
        assert np.diag(belief.P).max() <= 2.0 * (1.0 + 1e-12)
        assert np.array_equal(belief.P, belief.P.T)
        assert np.linalg.eigvalsh(belief.P)[0] > 0.0


@every(where=lambda v: "capped" in v.name and "pausing" not in v.name)
def test_a_capped_covariance_stays_sound_while_nothing_moves(variant):
    assert_sound(rest(variant, 1_000))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "samples"), [("ckf", 1_000_000), ("rls .95", 200_000)])
def test_a_capped_covariance_stays_sound_however_long_nothing_moves(name, samples):
    (variant,) = (variant for variant in VARIANTS if variant.name == f"{name} capped")
    assert_sound(rest(variant, samples))


@every(where=lambda v: v.name in ("rls .95", "ckf", "nkf"))
def test_without_a_cap_the_covariance_winds_up_where_it_is_inflated_and_nothing_moves(variant):
    samples, at_least = {"rls .95": (300, 1e6), "ckf": (1500, 1e6), "nkf": (1500, 1.0)}[
        variant.name
    ]
    *_, last = rest(variant, samples)
    assert np.trace(last.P) > at_least
    assert (np.trace(last.P) > 6.0) == (variant.name != "nkf")
