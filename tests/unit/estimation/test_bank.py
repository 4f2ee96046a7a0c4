"""The Lainiotis bank: laws of its probabilities, and the figures its documentation gives."""

import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from thermoctl.estimation import LainiotisBank, Order, RandomWalkKalman, start

MIXED = [Order(1, 1, 1), Order(2, 1, 2), Order(3, 2, 1), Order(2, 0), Order(0, 2, 3)]
NESTED = [Order(1, 1, 2), Order(2, 3, 2), Order(3, 1, 2), Order(1, 0)]


def plant(T, a=(1.2, -0.5), b=0.8, delay=2, seed=1, noise=0.3):
    """Return T samples (y(t), u(t-1)) of an AR(2) plant with one delayed input, from rest."""
    rng = np.random.default_rng(seed)
    y, u, samples = [0.0, 0.0], [0.0] * delay, []
    for _ in range(T):
        u.append(float(rng.normal()))
        y.append(a[0] * y[-1] + a[1] * y[-2] + b * u[-delay] + noise * float(rng.normal()))
        samples.append((y[-1], u[-1]))
    return samples


def banks(bank, samples):
    """Yield the bank after each sample."""
    for y, u in samples:
        bank = bank.update(y, u)
        yield bank


def taught(bank, samples):
    *_, last = banks(bank, samples)
    return last


@pytest.mark.parametrize("order", [Order(2, 1, 2), Order(1, 3, 1), Order(3, 0), Order(0, 2, 4)])
def test_one_candidate_is_the_random_walk_filter(order):
    law, belief = RandomWalkKalman(0.01, 0.5), start(order.n + order.m, 10.0)
    bank = LainiotisBank([order], R=0.5, P0=10.0, Q=0.01)
    y_past, u_past = np.zeros(9), np.zeros(9)
    for y, u in plant(200):
        u_past = np.append(u, u_past[:-1])
        phi = order.structure().regressor(y_past, u_past)
        expected, belief = float(phi @ belief.theta), law.update(belief, phi, y)
        bank = bank.update(y, u)
        assert bank.prediction == pytest.approx(expected, rel=1e-12, abs=1e-12)
        np.testing.assert_allclose(bank.theta, belief.theta, rtol=1e-12, atol=1e-13)
        assert bank.posterior.tolist() == [1.0]
        y_past = np.append(y, y_past[:-1])


def test_padding_changes_nothing_for_any_candidate():
    samples = plant(150)
    among_others = list(banks(LainiotisBank(MIXED, Q=0.01, floor=0.0), samples))
    alone = [list(banks(LainiotisBank([order], Q=0.01), samples)) for order in MIXED]
    seen = set()
    for t, bank in enumerate(among_others):
        i = MIXED.index(bank.best)
        seen.add(i)
        np.testing.assert_allclose(bank.theta, alone[i][t].theta, rtol=1e-11, atol=1e-12)
        predictions = [each[t].prediction for each in alone]
        prior = among_others[t - 1].posterior if t else np.full(len(MIXED), 1 / len(MIXED))
        assert bank.prediction == pytest.approx(float(prior @ predictions), rel=1e-11, abs=1e-12)
    assert len(seen) > 1  # more than one candidate was compared by its theta


def test_the_posterior_sums_to_one_and_keeps_its_floor():
    floor, k = 0.01, len(MIXED)
    for bank in banks(LainiotisBank(MIXED, R=0.1, floor=floor), plant(300)):
        assert bank.posterior.sum() == pytest.approx(1.0, rel=1e-12)
        assert bank.posterior.min() >= floor / (1 + (k - 1) * floor)
    assert bank.posterior.min() < floor  # raised to the floor first, then normalised


def test_the_floored_posterior_is_the_prior_of_the_next_sample():
    samples = plant(80)
    orders = [Order(1, 0), Order(2, 1, 2)]
    before = taught(LainiotisBank(orders, R=0.1, floor=0.05), samples)
    free = taught(LainiotisBank(orders, R=0.1, floor=0.0), samples)
    assert free.posterior[0] < 1e-20  # so that what is not floored would show
    likelihood = free.update(0.0, 0.0).posterior / free.posterior
    after = before.update(0.0, 0.0)
    expected = before.posterior * likelihood
    expected = np.maximum(expected / expected.sum(), 0.05)
    np.testing.assert_allclose(after.posterior, expected / expected.sum(), rtol=1e-9)


def test_permuting_the_candidates_permutes_the_posterior():
    samples, turned = plant(120), [3, 0, 4, 1, 2]
    ours = taught(LainiotisBank(MIXED, R=0.3), samples)
    theirs = taught(LainiotisBank([MIXED[i] for i in turned], R=0.3), samples)
    np.testing.assert_allclose(ours.posterior[turned], theirs.posterior, rtol=1e-9)
    assert ours.prediction == pytest.approx(theirs.prediction, rel=1e-9)
    assert ours.best == theirs.best


def test_one_sample_weighs_by_the_density_of_its_innovation():
    bank = LainiotisBank([Order(1, 0), Order(0, 1, 1)], R=2.0, P0=3.0, floor=0.0).update(5.0, 4.0)
    S = np.array([2.0, 2.0 + 3.0 * 4.0**2])  # the first knows no past, the second already u(t-1)
    L = np.exp(-(5.0**2) / (2 * S)) / np.sqrt(S)  # ALF (7)
    np.testing.assert_allclose(bank.posterior, L / L.sum(), rtol=1e-12)


def samples_to_decide(seed, a, P0, T):
    """Return after how many samples orders 1 to 4 give 95 % to the true 2; infinity for never."""
    bank = LainiotisBank([Order(n, 0) for n in (1, 2, 3, 4)], R=1.0, P0=P0)
    samples = plant(T, a=a, b=0.0, seed=seed, noise=1.0)
    decided = (t for t, bank in enumerate(banks(bank, samples), 1) if bank.posterior[1] >= 0.95)
    return next(decided, math.inf)


def test_a_second_order_plant_is_told_from_its_neighbours_in_some_two_dozen_samples():
    taken = [samples_to_decide(seed, (1.5, -0.7), 100.0, 300) for seed in range(60)]
    assert 18 <= np.median(taken) <= 32


def test_a_narrow_prior_hardly_ever_decides_the_order():
    taken = [samples_to_decide(seed, (1.5, -0.7), 1.0, 150) for seed in range(20)]
    assert sum(map(math.isfinite, taken)) <= 1


@pytest.mark.parametrize("delay", [1, 2, 3, 5])
def test_delays_are_told_apart(delay):
    candidates = [Order(2, 1, d) for d in range(1, 7)]
    bank = taught(LainiotisBank(candidates, R=0.09), plant(40, delay=delay))
    assert bank.best == Order(2, 1, delay)
    assert bank.posterior.max() > 0.95
    np.testing.assert_allclose(bank.theta, [-1.2, 0.5, 0.8], atol=0.3)


def samples_to_notice(floor):
    """Return how long a delay that grew from 1 to 3 goes unnoticed after 600 samples."""
    candidates = [Order(2, 1, 1), Order(2, 1, 3)]
    bank = LainiotisBank(candidates, R=0.09, Q=1e-3, floor=floor)
    bank = taught(bank, plant(600, delay=1))
    assert bank.best == candidates[0]
    after = enumerate(banks(bank, plant(1200, delay=3, seed=2)), 1)
    return next((t for t, bank in after if bank.best == candidates[1]), math.inf)


def test_the_floor_lets_a_candidate_come_back():
    assert samples_to_notice(1e-3) <= 20
    assert samples_to_notice(0.0) > 5 * samples_to_notice(1e-3)


def test_under_different_delays_theta_is_that_of_the_best():
    bank = taught(LainiotisBank([Order(1, 1, 2), Order(2, 1, 1)], R=0.3), plant(5))
    alone = taught(LainiotisBank([bank.best], R=0.3), plant(5))
    np.testing.assert_allclose(bank.theta, alone.theta, rtol=1e-12)


def test_candidates_without_inputs_are_nested_under_any_delay():
    bank = LainiotisBank([Order(3, 0, 7), Order(1, 2, 2)])
    assert taught(bank, plant(5)).theta.shape == (5,)


def test_a_likelihood_too_small_for_a_float_does_no_harm():
    bank = LainiotisBank([Order(1, 0), Order(2, 0)], R=1e-6, floor=0.0)
    bank = taught(bank, plant(2000, b=0.0, noise=1.0))  # log L is near -1e9
    assert bank.best == Order(2, 0)
    assert bank.posterior.tolist() == [0.0, 1.0]


@pytest.mark.slow
def test_a_hundred_thousand_samples_leave_the_posterior_sound():
    bank = LainiotisBank([Order(1, 0), Order(2, 0)], floor=0.0, Q=1e-9)
    bank = taught(bank, plant(100_000, b=0.0, noise=1.0))
    assert bank.best == Order(2, 0)
    assert bank.posterior.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(bank.theta, [-1.2, 0.5], atol=0.02)


@pytest.mark.parametrize(
    ("y", "u"),
    [(math.nan, 0.5), (1.0, math.inf), (-math.inf, 0.5), (1e200, 0.0), (0.0, 1e40), (9e24, 0.0)],
)
def test_a_sample_that_cannot_be_used_changes_nothing_but_the_mark(y, u):
    samples = plant(30)
    before = taught(LainiotisBank(MIXED, R=1e-3), samples[:20])
    marked = before.update(y, u)
    assert marked.rejected
    assert not before.rejected
    assert np.array_equal(marked.posterior, before.posterior)
    assert np.array_equal(marked.theta, before.theta)
    assert marked.prediction == before.prediction
    resumed, smooth = taught(marked, samples[20:]), taught(before, samples[20:])
    assert not resumed.rejected
    assert np.array_equal(resumed.posterior, smooth.posterior)
    assert resumed.prediction == smooth.prediction


def test_before_the_first_sample_all_candidates_are_equal_and_nothing_was_predicted():
    bank = LainiotisBank(NESTED)
    assert bank.posterior.tolist() == [0.25] * 4
    assert math.isnan(bank.prediction)
    assert bank.best == NESTED[0]
    assert not bank.theta.any()


def test_a_bank_never_changes():
    first = LainiotisBank(NESTED)
    second = first.update(1.0, 1.0)
    assert first.posterior.tolist() == [0.25] * 4
    assert second is not first
    for name in ("posterior", "theta"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(second, name)[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        second.R = 2.0


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("candidates", {"candidates": []}),
        ("candidates", {"candidates": [Order(1, 1), Order(2, 1), Order(1, 1, 1)]}),
        ("candidates", {"candidates": [Order(1, 0, 1), Order(1, 0, 2)]}),
        ("candidates", {"candidates": [(1, 1, 1)]}),
        ("candidates", {"candidates": Order(1, 1)}),
        ("candidates", {"candidates": None}),
        ("R", {"R": 0.0}),
        ("R", {"R": math.nan}),
        ("P0", {"P0": -1.0}),
        ("Q", {"Q": -1e-9}),
        ("Q", {"Q": math.nan}),
        ("Q", {"Q": np.eye(2)}),
        ("floor", {"floor": -0.1}),
        ("floor", {"floor": 0.51}),
        ("floor", {"floor": math.nan}),
    ],
)
def test_a_bank_refuses_by_name(name, arguments):
    with pytest.raises(ValueError, match=f"^{name} must"):
        LainiotisBank(**{"candidates": [Order(1, 1), Order(2, 1)], **arguments})


@pytest.mark.parametrize(
    ("numbers", "name"), [((0, 0, 1), "n and m"), ((1, 1, 0), "delay"), ((-1, 1, 1), "n")]
)
def test_an_order_refuses_what_is_no_structure(numbers, name):
    with pytest.raises(ValueError, match=f"^{name} must"):
        Order(*numbers)


@pytest.mark.parametrize(("y", "u", "name"), [("1", 0.0, "y"), (0.0, None, "u"), ([1.0], 0.0, "y")])
def test_what_is_no_number_is_refused_by_name(y, u, name):
    with pytest.raises(ValueError, match=f"^{name} must"):
        LainiotisBank(NESTED).update(y, u)
