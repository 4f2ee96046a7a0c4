"""What the adaptive controller remembers, how firmly, and whom it believes."""

import json
import math

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive
from thermoctl.control.adaptive.remembered import (
    DOUBLED_S,
    GAIN_SHARE,
    LOSING,
    LOSS_SHARE,
    WEIGHT_FLOOR,
    WEIGHT_POWER,
)
from thermoctl.control.adaptive.trial import DROPPED, TRUSTED
from thermoctl.estimation import start
from thermoctl.ports import Situation

NOTHING = start(n=1)
PAST = np.zeros(1)
LAW = Adaptive()
N = len(LAW.bank.hypotheses)


def situation(measured_c, applied, setpoint_c=40.0, period_s=1.0):
    return Situation(
        0.0, period_s, measured_c, setpoint_c, applied, NOTHING, PAST, PAST, measured_c
    )


class Tank:
    """Water behind dead time, element and sensor, with a little noise."""

    def __init__(self, gain=0.04, loss=0.004, lag_s=20.0, seed=1):
        self.gain, self.loss = gain, loss
        self.dead = [0.0] * round(0.2 * lag_s)
        self.element_s, self.sensor_s = 0.3 * lag_s, 0.5 * lag_s
        self.water_c = self.sensor_c = 25.0
        self.heat = 0.0
        self.random = np.random.default_rng(seed)

    def after(self, power):
        self.dead.append(power)
        self.heat += (self.dead.pop(0) - self.heat) / self.element_s
        self.sensor_c += (self.water_c - self.sensor_c) / self.sensor_s
        self.water_c += self.gain * self.heat - self.loss
        return self.sensor_c + 0.02 * self.random.standard_normal()


def played(tank, seconds, law=LAW, belief=None):
    """Return the beliefs of `law` while it heats `tank` to 40 degC."""
    belief = law.start() if belief is None else belief
    power, beliefs = 0.0, []
    for _ in range(seconds):
        seen = situation(tank.after(power), power)
        belief, power = law.decide(law.observe(belief, seen), seen)
        beliefs.append(belief)
    return beliefs


@pytest.fixture(scope="module")
def model():
    return LAW.remember(played(Tank(), 700)[-1])


def test_nothing_is_remembered_before_the_gain_is_known():
    assert LAW.remember(LAW.start()) is None
    quiet = LAW.start()
    for _ in range(60):
        quiet = LAW.observe(quiet, situation(25.0, 0.0))
    assert LAW.remember(quiet) is None


def test_what_is_remembered_is_plain_json_and_of_this_plant(model):
    assert json.loads(json.dumps(model, allow_nan=False)) == model
    assert model["gain_k_per_s"] == pytest.approx(0.04, rel=0.05)
    assert "coasting_c" not in model


def test_a_gain_that_rests_on_its_bound_is_not_remembered():
    cold = Tank(gain=0.0, loss=0.0)
    assert LAW.remember(played(cold, 900)[-1]) is None


def first_block(model, age_s=0.0):
    return LAW.observe(LAW.start_from(model, age_s), situation(31.0, 0.0)).bank.block


def test_gain_and_loss_come_back_with_room_to_be_wrong(model):
    begun = LAW.start_from(model, 0.0)
    bank, beside = begun.bank, begun.memory.held
    assert bank.block is None
    gain, gain_sd, loss, loss_sd, losing = bank.prior
    assert (losing, beside.belief.prior.losing) == (1.0, LOSING)
    assert (gain, loss) == (model["gain_k_per_s"], model["loss_k_per_s"])
    assert gain_sd == pytest.approx(GAIN_SHARE * gain)
    assert loss_sd == pytest.approx(max(LOSS_SHARE * gain, model["loss_sd_k_per_s"]))


def test_the_water_is_where_the_first_reading_says(model):
    block = first_block(model)
    assert block[:2, 4] == pytest.approx(31.0, abs=0.2)


def test_a_model_is_believed_less_the_older_it_is(model):
    now, later = (LAW.start_from(model, age_s).bank.prior for age_s in (0.0, 3.0 * DOUBLED_S))
    assert later.gain_sd == pytest.approx(2.0 * now.gain_sd)


def test_weights_come_back_tempered_and_no_hypothesis_is_lost(model):
    log = np.array(model["log_weights"])
    assert log.min() < -20.0
    back = LAW.start_from(model, 0.0).bank.weights
    assert back.log == pytest.approx(np.maximum(WEIGHT_POWER * log, WEIGHT_FLOOR))
    assert back.share.sum() == pytest.approx(1.0)
    assert back.likeliest == int(log.argmax())


def test_a_second_start_holds_what_the_first_had_to_learn(model):
    first, second = played(Tank(seed=2), 12), played(Tank(seed=2), 12, LAW, start_of(model))

    def off(beliefs):
        return abs(LAW.plant(beliefs[-1]).gain_k_per_s / 0.04 - 1.0)

    assert off(second) < 0.1 < off(first)


def start_of(model):
    return LAW.start_from(model, 3600.0)


def test_the_model_of_the_same_plant_is_trusted(model):
    last = played(Tank(seed=3), 300, LAW, start_of(model))[-1]
    assert last.memory.verdict == TRUSTED
    assert LAW.origin(last) == "stored"
    assert list(LAW.remarks(last)) == [TRUSTED]
    assert LAW.remember(last) is not None


@pytest.mark.parametrize(
    "plant",
    [{"gain": 0.08}, {"gain": 0.2}, {"lag_s": 5.0, "gain": 0.12}],
    ids=["half the water", "a fifth of it", "another vessel"],
)
def test_the_model_of_another_plant_is_dropped_within_a_minute(model, plant):
    beliefs = played(Tank(**plant), 90, LAW, start_of(model))
    dropped = next(i for i, each in enumerate(beliefs) if each.memory.verdict == DROPPED)
    assert dropped < 60
    assert LAW.origin(beliefs[-1]) == "dropped"


def test_what_takes_the_place_of_a_dropped_model_is_what_a_first_start_would_believe(model):
    """Bit for bit: the rival has seen the very samples, and nothing of the model."""
    tank, law = Tank(gain=0.2), LAW
    belief, fresh, power = start_of({**model, "noise_variance_k2": 0.001}), law.start(), 0.0
    while not belief.memory.verdict:
        seen = situation(tank.after(power), power)
        belief, power = law.decide(law.observe(belief, seen), seen)
        fresh = law.observe(fresh, seen)
    assert belief.memory.verdict == DROPPED
    assert np.array_equal(belief.bank.block, fresh.bank.block)
    assert np.array_equal(belief.bank.weights.log, fresh.bank.weights.log)


def test_there_is_no_verdict_and_nothing_is_stored_while_power_does_not_move(model):
    belief = start_of(model)
    for _ in range(400):
        belief = LAW.observe(belief, situation(25.0, 0.0))
    assert LAW.origin(belief) == "trial"
    assert LAW.remember(belief) is None
    assert LAW.remarks(belief) == {}


def test_on_trial_the_gain_is_no_better_known_than_at_a_first_start(model):
    seen = situation(25.0, 0.0)
    told = [
        LAW.beliefs(LAW.observe(begun, seen), seen).gain_sd
        for begun in (LAW.start(), start_of(model))
    ]
    assert told[1] == pytest.approx(told[0])


def test_a_gap_loses_the_path_of_both(model):
    beliefs = played(Tank(), 5, LAW, start_of(model))
    gone = LAW.observe(beliefs[-1], situation(25.0, 0.0, period_s=600.0))
    assert gone.bank.path.heat.max() == 0.0
    assert gone.memory.rival.path.heat.max() == 0.0


BAD = {
    "no gain": {"gain_k_per_s": None},
    "a gain of NaN": {"gain_k_per_s": math.nan},
    "a gain of nothing": {"gain_k_per_s": 0.0},
    "a negative gain": {"gain_k_per_s": -0.04},
    "a gain no heater has": {"gain_k_per_s": 25.0},
    "true as a gain": {"gain_k_per_s": True},
    "a text as a gain": {"gain_k_per_s": "0.04"},
    "a gain nobody knows": {"gain_sd_k_per_s": 0.04},
    "a negative deviation": {"gain_sd_k_per_s": -0.001},
    "more loss than power": {"loss_k_per_s": 0.05},
    "a loss that heats": {"loss_k_per_s": -0.05},
    "endless noise": {"noise_variance_k2": math.inf},
    "a coldest of NaN": {"coldest_c": math.nan},
    "a coldest that is no number": {"coldest_c": "cold"},
    "too few weights": {"log_weights": [0.0] * (N - 1)},
    "a weight of NaN": {"log_weights": [0.0] * (N - 1) + [math.nan]},
    "no weight of 0": {"log_weights": [-1.0] * N},
    "a weight above 0": {"log_weights": [0.0] * (N - 1) + [5.0]},
    "a weight below the floor": {"log_weights": [0.0] * (N - 1) + [-1e9]},
    "no weights at all": {"log_weights": None},
    "another period": {"period_s": 2.0},
    "another action": {"action": "cool"},
    "other hypotheses": {"hypotheses": {"lags": 16}},
}


@pytest.mark.parametrize("changed", BAD.values(), ids=BAD)
def test_what_is_implausible_is_refused_by_name(model, changed):
    (name,) = changed
    with pytest.raises(ValueError, match=f"expected {name}"):
        LAW.start_from({**model, **changed}, 0.0)


def test_nothing_at_all_is_refused():
    with pytest.raises(ValueError, match="expected action 'heat', got None"):
        LAW.start_from({}, 0.0)


def test_a_cooler_remembers_as_a_heater_does():
    cooler = Adaptive(action="cool")
    tank, belief, power = Tank(), cooler.start(), 0.0
    for _ in range(400):
        seen = situation(50.0 - tank.after(power), power, setpoint_c=15.0)
        belief, power = cooler.decide(cooler.observe(belief, seen), seen)
    kept = cooler.remember(belief)
    again = cooler.observe(cooler.start_from(kept, 0.0), situation(20.0, 0.0))
    assert cooler.plant(again).gain_k_per_s == pytest.approx(-0.04, rel=0.1)


def test_the_coldest_that_was_read_is_remembered(model):
    assert model["coldest_c"] == pytest.approx(25.0, abs=0.1)
    for bank in (start_of(model).bank, start_of(model).memory.rival):
        assert bank.noise.coldest_c == model["coldest_c"]
    hot = LAW.observe(start_of(model), situation(225.0, 0.0))
    assert hot.bank.noise.above_k == pytest.approx(180.0, abs=0.1)
    wrong_at_first = LAW.observe(hot, situation(205.0, 0.0))
    assert wrong_at_first.bank.noise.above_k == pytest.approx(162.0, abs=0.1)


@pytest.mark.parametrize("told", [{}, {"coldest_c": None}])
def test_a_model_of_an_older_version_knows_of_no_coldest(model, told):
    older = {name: each for name, each in model.items() if name != "coldest_c"}
    assert start_of(older | told).bank.noise.coldest_c == math.inf


def test_a_coldest_that_is_not_known_is_stored_as_such(model):
    last = played(Tank(), 700)[-1]
    noise = last.bank.noise._replace(coldest_c=math.inf)
    assert LAW.remember(last._replace(bank=last.bank._replace(noise=noise)))["coldest_c"] is None
