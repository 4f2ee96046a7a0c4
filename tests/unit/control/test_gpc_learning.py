"""The guarded filter that learns the model of GPC."""

import numpy as np
import pytest

from thermoctl.control.gpc.learning import Learner
from thermoctl.control.gpc.model import ChangeModel

MODEL = ChangeModel(3, 3, 1)
LEARNER = Learner(MODEL, gain_k=0.3, size=1, block_s=10.0)
TRUE = np.array([-0.6, 0.08, 0.06, 0.1, 0.04, 0.05])


def plant(powers, theta=TRUE, noise_k=0.0, seed=1):
    """Yield change, regressor and power of each block of a plant that is just like the model."""
    rng, changes_k = np.random.default_rng(seed), np.zeros(3)
    for t in range(3, len(powers)):
        phi = MODEL.regressor(changes_k, powers[t : t - 3 : -1])
        change_k = float(phi @ theta) + noise_k * rng.standard_normal()
        yield change_k, phi, float(powers[t])
        changes_k = np.concatenate(((change_k,), changes_k[:2]))


def learnt(blocks, belief=None, learner=LEARNER):
    belief = learner.start() if belief is None else belief
    for change_k, phi, power in blocks:
        belief = learner.update(belief, change_k, phi, power)
    return belief


def moving(blocks, seed=5):
    return np.repeat(np.random.default_rng(seed).uniform(0.0, 1.0, blocks // 4 + 1), 4)[:blocks]


def test_a_plant_that_is_just_like_the_model_is_learnt():
    belief = learnt(plant(moving(300), noise_k=0.002))
    assert belief.theta == pytest.approx(TRUE, abs=0.06)
    assert MODEL.gain_k(belief.theta) == pytest.approx(MODEL.gain_k(TRUE), rel=0.03)
    assert MODEL.holding(belief.theta) == pytest.approx(0.25, abs=0.01)


def test_a_power_that_rests_teaches_nothing_but_the_loss():
    before = learnt(plant(moving(300), noise_k=0.002))
    rests = learnt(plant(np.full(60, 0.25), noise_k=0.02), before)
    after = learnt(plant(np.full(3000, 0.25), noise_k=0.02, seed=2), rests)
    assert after.excited == 0.0
    assert np.array_equal(after.theta[:-1], rests.theta[:-1])
    assert np.array_equal(after.P[:-1, :-1], rests.P[:-1, :-1])
    assert after.theta[-1] != rests.theta[-1]


@pytest.mark.slow
def test_a_hundred_thousand_equal_readings_leave_the_model_as_it_is():
    before = learnt(plant(moving(300), noise_k=0.002))
    belief, phi = before, MODEL.regressor(np.zeros(3), np.full(3, 0.25))
    for _ in range(100_000):
        belief = LEARNER.update(belief, 0.0, phi, 0.25)
    assert MODEL.gain_k(belief.theta) == pytest.approx(MODEL.gain_k(before.theta), rel=0.1)
    assert MODEL.holding(belief.theta) == pytest.approx(0.25, abs=0.001)
    assert np.linalg.eigvalsh(belief.P).min() > 0.0
    assert (belief.P.diagonal() <= LEARNER.start().P.diagonal() * (1.0 + 1e-9)).all()
    again = learnt(plant(moving(300, seed=8), noise_k=0.002, seed=3), belief)
    assert MODEL.gain_k(again.theta) == pytest.approx(MODEL.gain_k(TRUE), rel=0.05)


def test_a_loss_that_changes_at_rest_is_followed():
    before = learnt(plant(moving(300), noise_k=0.002))
    colder = TRUE + np.array([0.0] * 5 + [0.03])
    after = learnt(plant(np.full(400, 0.4), colder, noise_k=0.002), before)
    assert MODEL.holding(after.theta) == pytest.approx(0.4, abs=0.02)


def test_no_variance_grows_beyond_what_it_began_with():
    first, belief = LEARNER.start(), LEARNER.start()
    for change_k, phi, power in plant(moving(2000), noise_k=0.5):
        belief = LEARNER.update(belief, change_k, phi, power)
        assert (belief.P.diagonal() <= first.P.diagonal() * (1.0 + 1e-12)).all()
    assert np.linalg.eigvalsh(belief.P).min() > 0.0
    assert np.array_equal(belief.P, belief.P.T)


def test_power_that_cools_leaves_the_gain_above_its_least():
    cooling = TRUE * np.array([1.0, 1.0, -1.0, -1.0, -1.0, 1.0])
    belief = LEARNER.start()
    for change_k, phi, power in plant(moving(400), cooling, noise_k=0.002):
        belief = LEARNER.update(belief, change_k, phi, power)
        assert (belief.theta[MODEL.inputs] >= 0.0).all()
        assert MODEL.gain_k(belief.theta) >= LEARNER.gain_min_k * (1.0 - 1e-9)
    assert MODEL.gain_k(belief.theta) < 0.5 * LEARNER.gain_k


def test_poles_stay_inside_however_wild_the_readings_are():
    rng, belief = np.random.default_rng(9), LEARNER.start()
    for _ in range(500):
        phi = MODEL.regressor(rng.normal(0.0, 3.0, 3), rng.uniform(0.0, 1.0, 3))
        belief = LEARNER.update(belief, float(rng.normal(0.0, 3.0)), phi, float(rng.uniform()))
        roots = np.roots(np.concatenate(((1.0,), belief.theta[:2])))
        assert np.abs(roots).max() <= np.exp(-10.0 / 140.0) + 1e-9
        assert -0.1 <= MODEL.holding(belief.theta) <= 0.95 + 1e-12


@pytest.mark.parametrize("n", [2, 3])
def test_poles_are_those_of_lags_however_wild_the_readings_are(n):
    model = ChangeModel(n, 3, 1)
    rng, learner = np.random.default_rng(9), Learner(model, gain_k=0.3, size=1, block_s=10.0)
    belief = learner.start()
    for _ in range(500):
        phi = model.regressor(rng.normal(0.0, 3.0, 3), rng.uniform(0.0, 1.0, 3))
        belief = learner.update(belief, float(rng.normal(0.0, 3.0)), phi, float(rng.uniform()))
        roots = np.roots(np.concatenate(((1.0,), belief.theta[: n - 1])))
        assert np.abs(roots.imag).max() < 1e-6  # a double pole is that far from a pair
        assert roots.real.min() >= -1e-9


def test_a_second_lag_is_not_taken_for_a_pole_that_swings():
    twice = np.array([-1.56, 0.608, 0.001, 0.01, 0.007, 0.0])  # 40 s each
    belief = learnt(plant(np.ones(40), twice, noise_k=0.002))
    assert MODEL.lag(belief.theta) == pytest.approx(MODEL.lag(twice), rel=0.35)


def test_a_loss_is_never_more_than_power_can_hold():
    hopeless = TRUE + np.array([0.0] * 5 + [0.3])
    belief = learnt(plant(moving(300), hopeless, noise_k=0.002))
    assert MODEL.holding(belief.theta) == pytest.approx(0.95)
    warming = TRUE - np.array([0.0] * 5 + [0.2])
    belief = learnt(plant(moving(300), warming, noise_k=0.002))
    assert MODEL.holding(belief.theta) == pytest.approx(-0.1, abs=0.002)


def test_water_poured_in_is_not_taken_for_a_change_of_the_plant():
    before = learnt(plant(moving(300), noise_k=0.002))
    blocks = list(plant(moving(40, seed=6), noise_k=0.002))
    poured = [(change_k - (3.0 if i == 10 else 0.0), phi, u)
              for i, (change_k, phi, u) in enumerate(blocks)]  # fmt: skip
    after = learnt(poured, before)
    assert after.since_jump == 40 - 3 - 1 - 10
    assert after.theta == pytest.approx(before.theta, abs=0.02)


def test_a_plant_that_has_changed_is_learnt_anew():
    before = learnt(plant(moving(300), noise_k=0.002))
    doubled = TRUE * np.array([1.0, 1.0, 2.0, 2.0, 2.0, 2.0])
    after = learnt(plant(moving(300, seed=6), doubled, noise_k=0.002), before)
    assert MODEL.gain_k(after.theta) == pytest.approx(2.0 * MODEL.gain_k(TRUE), rel=0.05)


def test_a_belief_is_left_as_it_was():
    before = learnt(plant(moving(50)))
    theta, P = before.theta.copy(), before.P.copy()
    learnt(plant(moving(50)), before)
    assert np.array_equal(before.theta, theta)
    assert np.array_equal(before.P, P)
    with pytest.raises(ValueError, match="read-only"):
        before.theta[0] = 1.0


def test_what_is_not_finite_is_never_kept():
    phi = MODEL.regressor(np.zeros(3), np.ones(3))
    with pytest.raises(ArithmeticError, match="expected a finite model after a change of nan K"):
        LEARNER.update(LEARNER.start(), float("nan"), phi, 1.0)
