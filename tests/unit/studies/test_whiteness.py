import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.studies.whiteness import FEWEST_SAMPLES, chi_square_tail, ljung_box


@pytest.mark.parametrize(
    ("x", "degrees", "tail"),
    [
        # Quantiles printed in every statistical table.
        (3.841458820694124, 1, 0.05),
        (6.634896601021213, 1, 0.01),
        (18.307038053275146, 10, 0.05),
        (31.410432844230918, 20, 0.05),
        (45.31474661812586, 20, 0.001),
        (10.850811394182585, 20, 0.95),
        (124.34211340400407, 100, 0.05),
    ],
)
def test_tail_agrees_with_printed_tables(x, degrees, tail):
    assert chi_square_tail(x, degrees) == pytest.approx(tail, rel=1e-9)


@given(x=st.floats(0.0, 1e3))
def test_tail_of_one_degree_is_that_of_a_squared_normal_variable(x):
    assert chi_square_tail(x, 1) == pytest.approx(math.erfc(math.sqrt(x / 2)), rel=1e-9, abs=1e-15)


@given(x=st.floats(0.0, 1e3))
def test_tail_of_two_degrees_is_an_exponential(x):
    assert chi_square_tail(x, 2) == pytest.approx(math.exp(-x / 2), rel=1e-9, abs=1e-15)


@given(x=st.floats(1e-6, 500.0), degrees=st.integers(1, 200))
def test_two_more_degrees_add_one_term(x, degrees):
    a, z = degrees / 2, x / 2
    term = math.exp(a * math.log(z) - z - math.lgamma(a + 1))
    more, less = chi_square_tail(x, degrees + 2), chi_square_tail(x, degrees)
    assert more == pytest.approx(less + term, rel=1e-9, abs=1e-12)


@given(degrees=st.integers(1, 1000))
def test_tail_falls_from_one_to_zero(degrees):
    x = np.linspace(0.0, 5.0 * degrees + 100.0, 60)
    tail = np.array([chi_square_tail(value, degrees) for value in x])
    assert tail[0] == 1.0
    assert np.all(np.diff(tail) <= 1e-14)
    assert 0.0 <= tail[-1] < 1e-9


@pytest.mark.parametrize(("x", "degrees"), [(-1.0, 3), (math.nan, 3), (1.0, 0)])
def test_tail_refuses_what_is_no_chi_square(x, degrees):
    with pytest.raises(ValueError, match="must"):
        chi_square_tail(x, degrees)


def test_statistic_is_the_formula_worked_by_hand():
    e = np.array([1.0, -1.0] * 10)
    # r1 = -19/20, r2 = 18/20; Q = 20 * 22 * (r1^2/19 + r2^2/18)
    expected = 20 * 22 * (0.95**2 / 19 + 0.9**2 / 18)
    assert ljung_box(e, lags=2).statistic == pytest.approx(expected, rel=1e-12)


def test_p_of_white_noise_is_uniform():
    rng = np.random.default_rng(7)
    p = np.array([ljung_box(rng.standard_normal(500)).p for _ in range(400)])
    for level in (0.1, 0.5, 0.9):
        assert np.mean(p < level) == pytest.approx(level, abs=0.06)


def test_a_memory_of_one_sample_is_found():
    rng = np.random.default_rng(8)
    noise = rng.standard_normal(1001)
    assert ljung_box(noise[1:] + 0.3 * noise[:-1]).p < 1e-6


def test_verdict_does_not_depend_on_unit_or_offset():
    e = np.random.default_rng(9).standard_normal(200)
    assert ljung_box(3.0 + 1e-3 * e).p == pytest.approx(ljung_box(e).p, rel=1e-9)


@pytest.mark.parametrize("e", [np.empty(0), np.ones(FEWEST_SAMPLES - 1), np.full(100, 2.0)])
def test_nothing_is_said_of_too_few_or_constant_innovations(e):
    assert math.isnan(ljung_box(e).p)


def test_unknown_innovations_are_passed_over():
    e = np.random.default_rng(10).standard_normal(100)
    assert ljung_box(np.concatenate((e, [math.nan, math.inf]))) == ljung_box(e)


@pytest.mark.parametrize("lags", [0, 100])
def test_lags_must_fit_the_record(lags):
    with pytest.raises(ValueError, match="lags"):
        ljung_box(np.arange(100.0), lags=lags)
