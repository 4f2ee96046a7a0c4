import math

import numpy as np
import pytest

from thermoctl.estimation import LainiotisBank, Order

ORDERS = [Order(1, 1, 1), Order(2, 1, 3), Order(1, 2, 2)]


def samples(count=60, seed=4):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(count), rng.choice((0.0, 1.0), count)


def test_what_is_remembered_teaches_nothing():
    bank = LainiotisBank(ORDERS)
    for y, u in zip(*samples(), strict=True):
        bank = bank.remember(y, u)
    assert bank.posterior == pytest.approx(np.full(3, 1 / 3), abs=1e-15)
    assert not bank.theta.any()
    assert math.isnan(bank.prediction)


def test_a_remembered_past_is_the_past_of_the_next_update():
    y, u = samples()
    reach = 3
    primed, elsewhere = LainiotisBank(ORDERS), LainiotisBank(ORDERS).remember(9.0, 7.0)
    for t in range(reach):
        primed, elsewhere = primed.remember(y[t], u[t]), elsewhere.remember(y[t], u[t])
    for t in range(reach, len(y)):
        primed, elsewhere = primed.update(y[t], u[t]), elsewhere.update(y[t], u[t])
    assert np.array_equal(primed.posterior, elsewhere.posterior)
    unprimed = LainiotisBank(ORDERS)
    for t in range(reach, len(y)):
        unprimed = unprimed.update(y[t], u[t])
    assert not np.array_equal(primed.posterior, unprimed.posterior)


def test_a_sample_that_is_no_number_is_not_remembered():
    bank = LainiotisBank(ORDERS).remember(1.0, 0.5)
    after = bank.remember(math.nan, 0.5)
    assert after.rejected
    assert not after.remember(2.0, 0.5).rejected
    y, u = samples()
    assert np.array_equal(after.update(y[0], u[0]).posterior, bank.update(y[0], u[0]).posterior)


def test_a_past_that_is_no_single_number_is_refused_by_name():
    with pytest.raises(ValueError, match="u must be a single number"):
        LainiotisBank(ORDERS).remember(1.0, np.ones(2))
