"""What the self-tuning law remarks on, and a condition that must last to be news."""

import math

import numpy as np
import pytest

from thermoctl.control.lasting import APPEARS_AFTER, GONE_AFTER, Lasting
from thermoctl.control.minimum_variance import SelfTuningMinimumVariance
from thermoctl.estimation import Identifier, RandomWalkKalman, start
from thermoctl.model.arx import Arx, KnownGain
from thermoctl.ports import Situation
from thermoctl.regulator import Limits, Plan, Regulator
from thermoctl.signals import Measurement, Mode

INSIDE, OUTSIDE = [-0.95, 0.2, 0.1], [-0.95, 0.1, 0.2]


def after(condition, *texts):
    for text in texts:
        condition = condition.after(text)
    return condition


def test_a_condition_stands_when_it_was_met_a_few_times_in_a_row():
    almost = after(Lasting(), *["met"] * (APPEARS_AFTER - 1))
    assert not almost.stands
    assert almost.after("met now") == Lasting(True, 0, "met now")
    assert not after(almost, "", *["met"] * (APPEARS_AFTER - 1)).stands


def test_a_condition_ends_when_it_was_not_met_for_long_and_keeps_its_first_text_till_then():
    stands = after(Lasting(), *["first"] * APPEARS_AFTER, "later")
    almost = after(stands, *[""] * (GONE_AFTER - 1))
    assert (almost.stands, almost.text) == (True, "first")
    assert almost.after("") == Lasting()
    assert after(almost, "met", *[""] * (GONE_AFTER - 1)).stands


def test_a_condition_that_flickers_is_news_once():
    condition, changes = Lasting(), 0
    for met in np.random.default_rng(1).uniform(size=20_000) < 0.5:
        before, condition = condition, condition.after("met" if met else "")
        changes += before.stands is not condition.stands
    assert changes == 1


def seen(law, theta, belief=None, samples=APPEARS_AFTER):
    """Return the belief after `samples` with these parameters."""
    structure = law.structure
    here = Situation(
        0.0,
        1.0,
        37.0,
        37.5,
        0.2,
        start(len(theta), 1e-12, theta),
        np.full(structure.y_memory, 37.0),
        np.full(structure.u_memory, 0.2),
    )
    belief = law.start() if belief is None else belief
    for _ in range(samples):
        belief = law.observe(belief, here)
    return belief


def test_a_law_that_does_not_cancel_says_which_zero_it_leaves_and_when_it_is_inside_again():
    law = SelfTuningMinimumVariance(Arx(1, 2), zero_radius=0.9)
    outside = seen(law, OUTSIDE)
    assert law.remarks(outside) == {
        "controller.detuned": "expected zeros of B within radius 0.9, got one at 2"
    }
    assert law.remarks(seen(law, INSIDE, outside, GONE_AFTER - 1)) != {}
    assert law.remarks(seen(law, INSIDE, outside, GONE_AFTER)) == {}
    assert law.remarks(seen(law, INSIDE)) == {}


@pytest.mark.parametrize(
    "law",
    [
        SelfTuningMinimumVariance(Arx(1, 2), zero_radius=math.inf),
        SelfTuningMinimumVariance(Arx(1, 2), zero_radius=2.1),
    ],
    ids=repr,
)
def test_what_is_cancelled_is_not_remarked_on(law):
    assert law.remarks(seen(law, OUTSIDE)) == {}


@pytest.mark.parametrize("b", [(0.0, 0.2), (1e-310, 0.2), (0.0, 0.2, 0.1), (1e-310, 0.2, 0.1)])
def test_a_first_input_next_to_without_effect_is_a_zero_at_infinity(b):
    law = SelfTuningMinimumVariance(Arx(1, len(b)))
    told = law.remarks(seen(law, [-0.95, *b]))
    assert "got one at inf" in told["controller.detuned"]


@pytest.mark.parametrize(
    "zeros", [[-2.5], [0.0], [0.5, -1.5], [0.5 + 2.0j, 0.5 - 2.0j, 1.0], [0.0, 0.0, -1.25]]
)
def test_the_zero_that_is_named_is_the_farthest(zeros):
    b = 0.2 * np.poly(zeros).real
    law = SelfTuningMinimumVariance(Arx(1, len(b)), zero_radius=1e-3)
    farthest = max(map(abs, zeros))
    told = law.remarks(seen(law, [-0.95, *b]))
    text = f"expected zeros of B within radius 0.001, got one at {farthest:.3g}"
    assert told == ({"controller.detuned": text} if farthest else {})


@pytest.mark.parametrize(("b", "least"), [(0.005, 0.01), (0.0, 0.01), (-0.04, 0.01), (-0.04, 0.0)])
def test_a_gain_below_its_bound_or_of_the_wrong_sign_is_remarked_on(b, least):
    law = SelfTuningMinimumVariance(Arx(1, 1), gain_min_k=least)
    text = f"expected at least {least:g} K a sample at full power, got {b:g}"
    assert law.remarks(seen(law, [-0.98, b])) == {"controller.gain_doubtful": text}
    assert law.remarks(seen(law, [-0.98, 0.02])) == {}


def test_a_known_gain_has_nothing_to_remark():
    law = SelfTuningMinimumVariance(KnownGain(0.0449), 60.0, gain_min_k=0.01)
    assert law.remarks(seen(law, [0.9])) == {}


def regulated(on_zeros, theta0):
    """Return the steps of a regulator whose model is what it was given."""
    structure = Arx(1, 2, y_centre_c=20.0)
    law = SelfTuningMinimumVariance(structure, 30.0, on_zeros=on_zeros)
    identifier = Identifier(structure, RandomWalkKalman(0.0, 1.0), theta0, 1e-12)
    regulator = Regulator(Plan(Limits(60.0, 0.0, 5.0, 50.0), identifier, law, 37.5, Mode.AUTO))
    return [regulator.step(Measurement(float(t), 37.0)) for t in range(8)]


def test_a_law_that_refuses_gives_no_power_and_says_why():
    steps = regulated("refuse", OUTSIDE)
    assert {step.command.power for step in steps} == {0.0}
    told = [event.fields.get("text") for step in steps for event in step.events]
    assert "expected zeros of B within radius 1, got one at 2" in told
    assert "output.nan" in [alarm.code for alarm in steps[-1].alarms]


@pytest.mark.parametrize(("on_zeros", "theta0"), [("detune", OUTSIDE), ("refuse", INSIDE)])
def test_a_law_that_does_not_refuse_gives_power(on_zeros, theta0):
    steps = regulated(on_zeros, theta0)
    assert min(step.command.power for step in steps) > 0.0
    names = {event.name for step in steps for event in step.events}
    assert names == ({"controller.detuned"} if on_zeros == "detune" else set())
