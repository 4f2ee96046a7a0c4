"""The bank behind the port: time, power, words, and what it is not fooled by."""

import math
import re

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive
from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.coasting import power_for
from thermoctl.control.adaptive.constants import Pace
from thermoctl.estimation import start
from thermoctl.ports import Situation
from thermoctl.signals import PlantBelief

NOTHING = start(1)
EMPTY = np.empty(0)


def situation(y, applied, r=37.5, interval_s=1.0):
    """Return a situation of which an adaptive law uses four numbers."""
    return Situation(0.0, interval_s, y, r, applied, NOTHING, EMPTY, EMPTY, y)


class Vessel:
    """First-order heater and sensor on water that loses heat; steps of `step_s`."""

    def __init__(self, gain=0.036, loss=0.009, water_c=25.0, noise_k=0.005, seed=1):
        self.gain, self.loss, self.water_c, self.noise_k = gain, loss, water_c, noise_k
        self.sensor_c, self.heat = water_c, 0.0
        self.rng = np.random.default_rng(seed)

    def reading(self, power, step_s=1.0):
        """Return what is read `step_s` later."""
        self.heat += (1.0 - math.exp(-step_s / 14.0)) * (power - self.heat)
        self.water_c += step_s * (self.gain * self.heat - self.loss)
        self.sensor_c += (1.0 - math.exp(-step_s / 6.0)) * (self.water_c - self.sensor_c)
        return self.sensor_c + self.noise_k * self.rng.standard_normal()


def steered(law, vessel, samples, r=37.5):
    """Return the belief and every water temperature of a loop."""
    belief, power, waters = law.start(), 0.0, []
    y = vessel.water_c
    for _ in range(samples):
        now = situation(y, power, r)
        belief = law.observe(belief, now)
        belief, power = law.decide(belief, now)
        y = vessel.reading(power)
        waters.append(vessel.water_c)
    return belief, np.array(waters)


def test_a_vessel_it_has_never_seen_comes_to_rest_at_the_set_point():
    belief, waters = steered(Adaptive(), Vessel(), 1500)
    assert waters.max() < 37.55
    assert np.abs(waters[700:] - 37.5).max() < 0.03
    plant = Adaptive().plant(belief)
    assert plant.gain_k_per_s == pytest.approx(0.036, rel=0.1)
    assert plant.holding_power == pytest.approx(0.25, abs=0.02)
    assert plant.lag_low_s <= plant.lag_s <= plant.lag_high_s
    assert plant.lag_s == pytest.approx(20.0, rel=0.3)
    assert plant.noise_sd_k == pytest.approx(0.005, rel=0.5)


def test_a_cooler_is_a_heater_seen_upside_down():
    heated, cooled = Vessel(noise_k=0.0), Vessel(gain=-0.036, loss=-0.009, noise_k=0.0)
    heating, cooling = Adaptive(), Adaptive(action="cool")
    hot, waters = steered(heating, heated, 600)
    cold, mirrored = steered(cooling, cooled, 600, r=12.5)
    assert mirrored - 25.0 == pytest.approx(25.0 - waters, abs=1e-6)
    assert cooling.plant(cold).gain_k_per_s == pytest.approx(-heating.plant(hot).gain_k_per_s)
    assert cooling.plant(cold).coasting_c == pytest.approx(12.5, abs=0.1)
    assert cooling.beliefs(cold, situation(12.5, 0.2)).gain < 0.0


def test_calmness_divides_the_power_an_error_is_met_with():
    belief, _ = steered(Adaptive(), Vessel(), 1000)
    outlook, path = belief.bank.outlook, belief.bank.path
    held = np.full_like(path.powers, outlook.holding_power)
    still = outlook._replace(surplus=0.0, spread_k=0.0)
    bank = belief.bank._replace(path=path._replace(powers=held), outlook=still)
    belief = belief._replace(bank=bank)
    aims = []
    for calmness in (0.3, 0.6, 1.2):
        now = situation(37.5, 0.2, outlook.coasting_c + 0.02)
        more = Adaptive(calmness=calmness).decide(belief, now)[1] - outlook.holding_power
        Tc_s = calmness * outlook.lag_s
        aims.append(more * (1.0 + Pace().smoothness * Tc_s) * Tc_s * outlook.gain)
    assert aims == pytest.approx([0.02] * 3)


# -- time -----------------------------------------------------------------------------------------


def test_a_late_sample_is_as_good_as_the_missing_ones_before_it():
    law = Adaptive()
    before, _ = steered(law, Vessel(), 200)
    late = law.observe(before, situation(31.0, 0.7, interval_s=3.0))
    one_by_one = before
    for y in (math.nan, math.nan, 31.0):
        one_by_one = law.observe(one_by_one, situation(y, 0.7))
    assert np.array_equal(late.bank.block, one_by_one.bank.block)
    assert late.bank.sample == before.bank.sample + 3


def test_samples_that_come_faster_than_the_period_give_their_mean_power():
    law = Adaptive()
    before, _ = steered(law, Vessel(), 200)
    belief = law.observe(before, situation(31.0, 0.9, interval_s=0.4))
    assert belief.bank is before.bank
    belief = law.observe(belief, situation(31.0, 0.3, interval_s=0.8))
    assert belief.bank.sample == before.bank.sample + 1
    assert belief.bank.path.powers[0] == pytest.approx((0.4 * 0.9 + 0.8 * 0.3) / 1.2)
    assert belief.behind_s == pytest.approx(0.2)


def test_a_reading_is_compared_with_what_was_foreseen_a_period_before_and_no_other_time():
    law = Adaptive()
    before, _ = steered(law, Vessel(), 200)
    cooler = Adaptive(action="cool")
    seen = law.observe(before, situation(31.0, 0.7))
    assert law.surprise_k(seen, situation(31.0, 0.7)) == seen.bank.surprise_k
    assert cooler.observe(before, situation(-31.0, 0.7)).surprise_k == -seen.bank.surprise_k
    unseen = law.observe(before, situation(math.nan, 0.7))
    early = law.observe(before, situation(31.0, 0.7, interval_s=0.4))
    gathered = law.observe(early, situation(31.0, 0.7, interval_s=0.8))
    late, lost = (law.observe(before, situation(31.0, 0.7, interval_s=s)) for s in (3.0, 100.0))
    for belief in (law.start(), unseen, early, gathered, late, lost):
        assert math.isnan(belief.surprise_k)


def test_jitter_of_the_clock_adds_and_loses_no_period():
    law, rng = Adaptive(), np.random.default_rng(2)
    belief, t_s, k = law.start(), 0.0, 0
    for k in range(1, 400):
        next_s = k + rng.uniform(-0.2, 0.2)
        belief = law.observe(belief, situation(25.0, 0.1, interval_s=next_s - t_s))
        t_s = next_s
    assert abs(belief.bank.sample + 1 - k) <= 1


def test_after_a_gap_in_which_commands_expired_no_heat_is_believed_to_be_under_way():
    law = Adaptive()
    before, _ = steered(law, Vessel(), 200)
    assert before.bank.path.heat.max() > 0.5
    belief = law.observe(before, situation(28.0, 1.0, interval_s=3600.0))
    assert belief.bank.path.heat.max() == 0.0
    assert belief.bank.sample == before.bank.sample + 1
    assert law.plant(belief).coasting_c == pytest.approx(28.0, abs=0.3)


# -- whoever steers -------------------------------------------------------------------------------


def test_what_is_learnt_under_another_law_makes_the_change_bumpless():
    law, vessel = Adaptive(), Vessel()
    belief, power, y = law.start(), 0.0, 25.0
    for _ in range(900):  # a thermostat steers
        belief = law.observe(belief, situation(y, power))
        power = 1.0 if y < 37.5 else 0.0
        y = vessel.reading(power)
    waters = []
    for _ in range(600):
        now = situation(y, power)
        belief = law.observe(belief, now)
        belief, power = law.decide(belief, now)
        y = vessel.reading(power)
        waters.append(vessel.water_c)
    assert np.abs(np.array(waters[120:]) - 37.5).max() < 0.05


def test_nothing_is_asked_for_before_the_first_reading_or_without_a_set_point():
    law = Adaptive()
    belief = law.observe(law.start(), situation(math.nan, 0.0))
    assert math.isnan(law.decide(belief, situation(math.nan, 0.0))[1])
    assert law.plant(belief) is None
    assert law.ride_s(belief) == 0.0
    assert law.beliefs(belief, situation(math.nan, 0.0)).gain is None
    belief = law.observe(belief, situation(25.0, 0.0))
    assert 0.0 <= law.decide(belief, situation(25.0, 0.0))[1] <= 1.0
    assert math.isnan(law.decide(belief, situation(25.0, 0.0, r=math.nan))[1])


def test_without_readings_it_steers_on_its_own_prediction():
    law, vessel = Adaptive(), Vessel()
    belief, _ = steered(law, vessel, 1200)
    power, waters = law.decide(belief, situation(37.5, 0.0))[1], []
    for _ in range(60):
        vessel.reading(power)
        waters.append(vessel.water_c)
        blind = situation(math.nan, power)
        belief = law.observe(belief, blind)
        belief, power = law.decide(belief, blind)
    assert np.abs(np.array(waters) - 37.5).max() < 0.1


# -- words ----------------------------------------------------------------------------------------


def test_holding_power_is_told_only_once_it_is_known():
    law = Adaptive()
    belief = law.observe(law.start(), situation(25.0, 0.0))
    assert law.beliefs(belief, situation(25.0, 0.0)).holding_power is None
    belief, _ = steered(law, Vessel(), 1200)
    told = law.beliefs(belief, situation(37.5, 0.25))
    assert told.holding_power == pytest.approx(0.25, abs=0.02)
    assert abs(told.gain - 0.036) < 4.0 * told.gain_sd + 0.002


def test_it_rides_for_three_lags_but_no_longer_than_a_minute():
    law = Adaptive()
    belief, _ = steered(law, Vessel(), 600)
    assert law.ride_s(belief) == pytest.approx(min(3.0 * law.plant(belief).lag_s, 60.0))
    slow = belief.bank.outlook._replace(lag_s=40.0)
    fast = belief.bank.outlook._replace(lag_s=5.0)
    for outlook, ride_s in ((slow, 60.0), (fast, 15.0)):
        assert law.ride_s(belief._replace(bank=belief.bank._replace(outlook=outlook))) == ride_s


@pytest.mark.parametrize("gain", [-0.036, 0.0])
def test_a_heater_that_cools_or_is_dead_is_remarked_on(gain):
    law = Adaptive()
    belief, _ = steered(law, Vessel(gain=gain, loss=0.002), 900)
    remarks = law.remarks(belief)
    assert list(remarks) == ["controller.gain_doubtful"]
    assert (
        "expected more than 4e-05 K/s at full power, learnt" in remarks["controller.gain_doubtful"]
    )


def test_a_plant_quicker_than_any_that_is_believed_in_is_held_and_remarked_on():
    law = Adaptive()
    quick = Vessel(gain=5.0, loss=0.8, noise_k=0.05)
    belief, waters = steered(law, quick, 1500, r=120.0)
    assert re.fullmatch(
        r"expected less than [\d.]+ K/s with a lag of \d+ s, learnt [\d.]+",
        law.remarks(belief)["controller.gain_doubtful"],
    )
    assert np.abs(waters[900:] - 120.0).max() < 0.1


def test_a_board_that_rises_by_seven_tenths_of_a_kelvin_a_second_is_believed_in():
    law = Adaptive()
    belief, waters = steered(law, Vessel(gain=0.7, loss=0.2, noise_k=0.05), 900, r=60.0)
    assert 0.52 < law.plant(belief).gain_k_per_s < 0.8
    assert np.abs(waters[500:] - 60.0).max() < 0.1
    assert law.remarks(belief) == {}


def test_a_sound_heater_is_not_remarked_on_even_if_it_is_weak():
    law = Adaptive()
    belief, _ = steered(law, Vessel(gain=0.0008, loss=0.0002), 1500)
    assert law.remarks(belief) == {}


def test_every_word_on_the_plant_has_a_meaning_of_its_own():
    belief, _ = steered(Adaptive(), Vessel(), 300)
    plant = Adaptive().plant(belief)
    assert isinstance(plant, PlantBelief)
    for name in PlantBelief.__slots__:
        value = getattr(plant, name)
        assert isinstance(value, bool) or math.isfinite(value), name
    assert min(plant.gain_sd_k_per_s, plant.loss_sd_k_per_s, plant.holding_power_sd) > 0.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("calmness", 0.0), ("calmness", math.nan), ("calmness", "brisk"), ("period_s", -1.0),
     ("action", "freeze"), ("action", None)],
)  # fmt: skip
def test_a_bad_setting_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"^{name} must .*, got"):
        Adaptive(**{name: value})


def test_a_plant_that_is_heated_and_cooled_goes_either_way_without_overshoot():
    bank, vessel = Bank(u_min=-0.4), Vessel()
    belief, power, y = bank.start(), 0.0, 25.0
    waters = []
    for k in range(2400):
        r = 37.5 if k < 1200 else 31.0
        belief = bank.observe(belief, y, power)
        power = power_for(belief.outlook, r, 0.6, 1.0, bank.bounds, power)
        y = vessel.reading(power)
        waters.append(vessel.water_c)
    assert max(waters) < 37.6
    assert min(waters[1200:]) > 30.9
    assert min(waters[1500:1600]) < 31.1  # by its loss alone it would need 720 s


def test_temperatures_have_no_zero():
    laws = [Adaptive(), Adaptive()]
    beliefs, powers = [law.start() for law in laws], []
    rng = np.random.default_rng(9)
    for k in range(200):
        y, applied = 25.0 + 0.03 * k + 0.01 * rng.standard_normal(), float(k % 60 < 40)
        asked = []
        for number, away_c in enumerate((0.0, 300.0)):
            now = situation(y + away_c, applied, 31.5 + away_c)
            beliefs[number] = laws[number].observe(beliefs[number], now)
            asked.append(laws[number].decide(beliefs[number], now)[1])
        powers.append(asked)
    here, there = np.array(powers).T
    assert there == pytest.approx(here, abs=1e-6)
    assert np.ptp(here) > 0.5


@pytest.mark.slow
def test_six_quiet_hours_leave_the_gain_where_it_was_learnt():
    law = Adaptive()
    early, late = (
        law.plant(steered(law, Vessel(noise_k=0.02), seconds)[0]) for seconds in (1200, 6 * 3600)
    )
    assert late.gain_k_per_s == pytest.approx(early.gain_k_per_s, abs=0.001)
    assert late.gain_k_per_s == pytest.approx(0.036, abs=2.0 * late.gain_sd_k_per_s)
    assert late.gain_sd_k_per_s < 0.003


@pytest.mark.parametrize("first_c", [85.0, 0.0, -40.0])
@pytest.mark.parametrize("samples", [1, 5])
@pytest.mark.slow
def test_nonsense_in_the_first_readings_is_forgotten_within_the_warm_up(first_c, samples):
    law, vessel, waters = Adaptive(), Vessel(), []
    belief, power, y = law.start(), 0.0, 25.0
    for k in range(900):
        now = situation(first_c if k < samples else y, power)
        belief = law.observe(belief, now)
        belief, power = law.decide(belief, now)
        y = vessel.reading(power)
        waters.append(vessel.water_c)
    assert max(waters) < 37.5 + 0.4
    assert np.abs(np.array(waters[650:]) - 37.5).max() < 0.05
