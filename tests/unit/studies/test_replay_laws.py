import math

import pytest

from thermoctl.estimation import CorrectedKalman, RandomWalkKalman, RecursiveLeastSquares
from thermoctl.model.arx import Arx
from thermoctl.studies.laws import parameter_names, parse_law, parse_order, prepare


@pytest.mark.parametrize(
    ("text", "name", "constants"),
    [
        ("ckf", "ckf", {"R1": 0.0, "inflation_max": math.inf}),
        ("ckf:inflation_max=4", "ckf", {"R1": 0.0, "inflation_max": 4.0}),
        ("NKF:R1=1e-6", "nkf", {"R1": 1e-6}),
        ("nkf:1e-6", "nkf", {"R1": 1e-6}),
        (" rls ", "rls", {"forgetting": 1.0}),
        ("rls:0.98", "rls", {"forgetting": 0.98}),
        ("vff", "vff", {"N0": 100.0, "forgetting_min": 0.2}),
        ("vff:10,forgetting_min=0.5", "vff", {"N0": 10.0, "forgetting_min": 0.5}),
    ],
)
def test_words_become_a_law_with_its_constants(text, name, constants):
    spec = parse_law(text)
    assert (spec.text, spec.name, spec.constants) == (text.strip(), name, constants)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("kalman", "expected an estimator such as ckf, nkf"),
        ("", "expected an estimator"),
        ("rls:fast", "expected a number for forgetting, got 'fast'"),
        ("rls:0.98,0.97", "expected constants out of forgetting; got '0.97'"),
        ("nkf:R2=1", "expected constants out of R1; got 'R2=1'"),
        ("rls:1.2", "forgetting"),
        ("nkf:R1=-1", "R1"),
        ("ckf:inflation_max=nan", "inflation_max"),
        ("vff:0", "Sigma0"),
    ],
)
def test_what_is_no_law_is_refused_with_what_was_expected(text, why):
    with pytest.raises(ValueError, match=why):
        parse_law(text)


@pytest.mark.parametrize("text", ["2,2", "2,2,1,1", "a,b,c", "", "2,2,0", "0,0,1", "-1,2,1"])
def test_what_is_no_order_is_refused(text):
    with pytest.raises(ValueError, match=r"expected n,m,d|must"):
        parse_order(text)


def test_an_order_names_its_parameters():
    order = parse_order("2,1,3")
    assert order == Arx(2, 1, 3)
    assert parameter_names(order) == ("a1", "a2", "b1")


def test_noise_of_the_record_reaches_every_law():
    assert prepare(parse_law("nkf"), 2, 0.25, 100.0).law.R2 == 0.25
    assert prepare(parse_law("ckf"), 2, 0.25, 100.0).law.R2 == 0.25
    assert prepare(parse_law("vff:10"), 2, 0.25, 100.0).law.Sigma0 == 2.5


def test_all_laws_start_from_the_same_covariance():
    for text, law in [
        ("nkf", RandomWalkKalman),
        ("ckf", CorrectedKalman),
        ("rls", RecursiveLeastSquares),
    ]:
        prepared = prepare(parse_law(text), 3, 0.25, 100.0)
        assert isinstance(prepared.law, law)
        assert (prepared.unit_variance * prepared.prior.P).diagonal().tolist() == [100.0] * 3
