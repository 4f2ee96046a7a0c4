"""The watch over a heater, on a plant of two lines: an integrator with loss behind two lags."""

import math
from collections import deque

import numpy as np
import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.errors import ConfigError
from thermoctl.regulator.heater.blocks import Block, Blocks
from thermoctl.regulator.heater.check import HeaterCheck, weakest_of
from thermoctl.regulator.heater.question import Answer, contrast, of_known, of_unknown
from thermoctl.regulator.heater.response import Gain, HeatResponse, Seen
from thermoctl.regulator.heater.stuck_sensor import StuckSensor
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, State

LIMITS = Limits(200.0, -50.0, -50.0, 200.0)


class Plant:
    """Water, a supervisor and a watch; `power` is what is asked for, `does` what it really does."""

    def __init__(self, gain=0.04, loss=0.008, lag_s=20.0, seed=1, noise_k=0.01, **check):
        self.gain, self.loss, self.pole_s = gain, loss, lag_s / 2.0
        self.events = deque()
        self.supervisor = Supervisor(LIMITS, self.emit)
        self.watch = HeaterWatch(HeaterCheck(**check), 1.0, self.supervisor, self.emit)
        self.rng, self.noise_k = np.random.default_rng(seed), noise_k
        self.t_s, self.water_c, self.applied = 0.0, 25.0, 0.0
        self.first = self.second = 0.0
        self.does = lambda power: power
        self.shows = lambda water_c: water_c
        self.sign = -1.0 if check.get("action") == "cool" else 1.0

    def emit(self, name, **fields):
        self.events.append((self.t_s, name, fields))

    def names(self):
        return [name for _, name, _ in self.events if name.startswith("heater.")]

    def run(self, seconds, power):
        """Give `power`, a number or a function of the time, wherever nobody forbids it."""
        for _ in range(round(seconds)):
            self.first += (self.does(self.applied) - self.first) / self.pole_s
            self.second += (self.first - self.second) / self.pole_s
            self.water_c += self.sign * (self.gain * self.second - self.loss)
            self.t_s += 1.0
            reading_c = self.shows(self.water_c) + self.noise_k * self.rng.standard_normal()
            self.supervisor.judge(Measurement(self.t_s, reading_c), self.t_s, 1.0)
            self.watch.observe(self.t_s, 1.0, reading_c, self.applied)
            state = self.supervisor.rule(self.t_s, 0.0)
            asked = power(self.t_s) if callable(power) else power
            free = state is State.RUN and not self.watch.asks
            self.applied = asked if free else 0.0
        return self


def steps(t_s):
    """Return a power that moves between 0 and 60 % every two minutes."""
    return 0.6 if t_s % 240.0 < 120.0 else 0.0


def known(**keys):
    """Return a plant whose heater has been seen to heat."""
    plant = Plant(**keys).run(1200, steps)
    assert plant.names() == []
    return plant


def test_a_healthy_heater_is_never_asked():
    for seed, gain, lag_s in ((1, 0.04, 20.0), (2, 0.1, 5.0), (3, 0.01, 40.0)):
        plant = Plant(gain, 0.3 * gain, lag_s, seed).run(5000, steps)
        assert plant.names() == [], (gain, lag_s)


@pytest.mark.parametrize(
    ("does", "code"),
    [
        (lambda power: -power, "heater.reversed"),
        (lambda power: 0.0, "heater.no_response"),
        (lambda power: 1.0, "heater.stuck_on"),
    ],
    ids=["inverted", "dead", "stuck on"],
)
@pytest.mark.parametrize("action", ["heat", "cool"])
def test_a_heater_that_was_known_is_latched_when_it_does_something_else(does, code, action):
    plant = known(action=action)
    plant.does = does
    plant.run(900, steps)
    assert plant.supervisor.state is State.LATCHED
    assert plant.names()[-1] == code
    assert plant.applied == 0.0


def test_the_first_verdict_is_safe_and_the_second_within_half_an_hour_latches():
    plant = known()
    plant.does = lambda power: -power
    while "heater.reversed" not in plant.names():
        plant.run(1, 0.6)
    assert plant.supervisor.state is State.SAFE
    assert plant.supervisor.alarms.latched() == ()
    while plant.supervisor.state is not State.LATCHED:
        plant.run(1, 0.6)
    assert plant.names().count("heater.questioned") == 2


@pytest.mark.parametrize(
    ("does", "code"),
    [(lambda power: -power, "heater.reversed"), (lambda power: 0.0, "heater.no_response")],
    ids=["inverted", "dead"],
)
def test_a_heater_that_was_never_known_has_a_minute_of_full_power(does, code):
    plant = Plant(loss=0.0, weakest_k_per_s=0.005)
    plant.does = does
    plant.run(59, 1.0)
    assert not plant.watch.asks
    plant.run(10, 1.0)
    assert plant.watch.asks
    assert plant.applied == 0.0
    plant.run(900, 1.0)
    assert plant.supervisor.state is State.LATCHED
    assert plant.names()[-1] == code


@pytest.mark.slow
@pytest.mark.parametrize("noise_k", [0.0, 0.3])
def test_a_reading_that_never_answers_ends_the_heat_after_a_quarter_of_an_hour(noise_k):
    plant, given = Plant(noise_k=noise_k), deque([0.0], maxlen=1)
    plant.shows = lambda _: 25.0

    def full(_t_s):
        given.append(given[0] + plant.applied)
        return 1.0

    plant.run(4000, full)
    assert plant.supervisor.state is State.LATCHED
    assert plant.names()[-1] == "heater.no_response"
    assert given[0] < 960.0


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "noise_k"), [(2e-3, 0.3), (3e-4, 0.05)])
def test_a_weak_heater_in_noise_is_given_its_time(gain, noise_k):
    for seed in range(2):
        plant = Plant(gain, 0.2 * gain, 20.0, seed, noise_k).run(4000, 1.0)
        assert set(plant.names()) <= {"heater.questioned", "heater.answered"}, seed


def test_a_heater_at_its_limit_is_asked_once_and_goes_on():
    plant = Plant(gain=0.01, loss=0.01).run(7200, 1.0)
    assert plant.names() == ["heater.questioned", "heater.answered"]
    assert plant.applied == 1.0


@pytest.mark.slow
def test_fifty_watts_in_two_hundred_litres_are_a_heater():
    plant = Plant(gain=6e-5, loss=0.0, lag_s=20.0).run(4 * 3600, 1.0)
    assert set(plant.names()) <= {"heater.questioned", "heater.answered"}
    assert plant.supervisor.state is State.RUN


@pytest.mark.slow
@pytest.mark.parametrize("lag_s", [20.0, 90.0])
def test_the_weakest_heater_is_not_condemned_for_the_noise_of_a_burst(lag_s):
    for seed in (8, 28, 29):
        plant = Plant(gain=6e-5, loss=0.0, lag_s=lag_s, seed=seed, noise_k=0.012).run(5400, 1.0)
        assert set(plant.names()) <= {"heater.questioned", "heater.answered"}, seed


def in_air(plant, seed, wanders_k=0.05):
    """Return `plant` with its sensor in air that wanders by that, within three minutes or so."""
    rng, off_k = np.random.default_rng(seed), deque([0.0], maxlen=1)

    def shows(_):
        off_k.append(0.995 * off_k[0] + 0.1 * wanders_k * rng.standard_normal())
        return 22.0 + off_k[0]

    plant.shows = shows
    return plant


@pytest.mark.slow
def test_air_that_wanders_seldom_answers_for_a_heater_whose_sensor_hangs_in_it():
    plants = [in_air(Plant(weakest_k_per_s=9e-4, seed=seed), seed) for seed in range(8)]
    given_s = [sum(plant.run(1, 1.0).applied for _ in range(3600)) for plant in plants]
    assert sorted(given_s)[6] < 400.0
    assert [plant.watch.known for plant in plants].count(None) >= 7


@pytest.mark.slow
@pytest.mark.parametrize("wanders_k", [0.05, 0.1, 0.2])
def test_air_that_wanders_ends_in_a_fault_before_a_strong_heater_does_harm(wanders_k):
    """However often it answers: all the heat there was has to show somewhere."""
    for seed in range(6):
        plant = in_air(Plant(weakest_k_per_s=9e-3, seed=seed), seed, wanders_k)
        given_s = sum(plant.run(1, 1.0).applied for _ in range(7200))
        assert given_s < 500.0, seed
        assert plant.supervisor.rule(plant.t_s, 0.0) is State.LATCHED, seed


def test_what_the_air_has_shown_is_not_held_against_a_sensor_that_is_put_back():
    plant = in_air(Plant(gain=0.02, weakest_k_per_s=9e-3, seed=3), 3, 0.2).run(7200, 1.0)
    assert plant.supervisor.rule(plant.t_s, 0.0) is State.LATCHED
    plant.supervisor.acknowledge(None)
    plant.shows, plant.water_c = lambda water_c: water_c, 22.0
    plant.events.clear()
    plant.run(600, 1.0)
    assert plant.names() == []
    assert plant.watch.known is not None


def test_a_gain_below_that_of_the_weakest_plant_is_no_answer():
    t_s = np.arange(60) * 4.0
    heat_s = np.minimum(t_s, 120.0)
    rows = [
        Seen(float(t), 25.0 + 1e-3 * float(heat), (float(heat),) * 6)
        for t, heat in zip(t_s, heat_s, strict=True)
    ]
    found = contrast(rows, 1e-4)
    assert of_unknown(found, 5e-4, 0.0)[0] is Answer.HEATS
    assert of_unknown(found, 2e-3, 0.0)[0] is Answer.NOTHING


def test_a_rated_heater_is_no_weaker_than_in_the_largest_vessel():
    assert weakest_of(None) == weakest_of(1.0) == weakest_of(50.0) == 6e-5
    assert weakest_of(4186.0) == pytest.approx(1.0 / 400.0)
    for heater_w in (200.0, 4000.0):
        assert weakest_of(heater_w) < heater_w / (4186.0 * 200.0)
    assert HeaterCheck(weakest_of(1e9)).weakest_k_per_s == 0.5


@pytest.mark.parametrize(
    ("said", "weakest"),
    [
        ({}, 6e-5),
        ({"heater_w": 2093.0}, 1.25e-3),
        ({"heater_w": 2093.0, "volume_l": 10.0}, 0.01),
        ({"heater_w": 2093.0, "volume_l": 2000.0}, 5e-5),
        ({"heater_w": 0.1, "volume_l": 2000.0}, 1e-6),
        ({"heater_w": 9e9, "volume_l": 0.01}, 0.5),
        ({"heater_w": 2093.0, "heater_check": {"weakest_k_per_s": 0.02}}, 0.02),
        ({"heater_w": 1.0, "volume_l": 1.0, "heater_check": {"weakest_k_per_s": 0.02}}, 0.02),
    ],
)
def test_the_check_goes_by_watts_and_litres_unless_it_is_told_better(said, weakest):
    table = {"setpoint_c": 37.5, "trip_above_c": 60.0} | said
    plan = plan_for(load({"loops": {"tank": table}}).loops["tank"])
    assert plan.heater_check.weakest_k_per_s == pytest.approx(weakest)


def test_a_litre_of_cold_water_is_no_fault():
    plant = known()
    plant.water_c -= 4.0
    plant.run(1200, lambda t_s: 1.0 if plant.water_c < 38.0 else 0.2)
    assert plant.names() == []


def holding(plant, seed):
    """Return a power that holds 37.5 degC by proportion and integral, and is not quite steady."""
    rng, held = np.random.default_rng(seed), deque([0.2], maxlen=1)

    def power(_t_s):
        e = 37.5 - plant.water_c
        held.append(min(max(held[0] + 5e-4 * e, 0.0), 1.0))
        return min(max(held[0] + 0.2 * e + 0.1 * rng.standard_normal(), 0.0), 1.0)

    return power


def test_much_noise_raises_no_doubt():
    plant, rng = known(seed=5), np.random.default_rng(105)
    plant.noise_k = 0.4

    def power(_t_s):
        return min(max(0.25 + 0.1 * rng.standard_normal() - 0.2 * (plant.water_c - 37.5), 0.0), 1.0)

    plant.run(3000, power)
    assert plant.names() == []


@pytest.mark.slow
def test_a_heater_that_noise_hides_is_asked_and_not_condemned():
    asked = 0
    for seed in (0, 1, 2):
        plant = known(seed=seed)
        plant.water_c, plant.noise_k = 37.5, 0.8
        plant.run(2500, holding(plant, seed))
        plant.loss = 0.022  # a draught
        plant.run(2500, holding(plant, seed))
        asked += plant.names().count("heater.questioned")
        assert set(plant.names()) <= {"heater.questioned", "heater.answered"}, seed
    assert asked


def test_a_sensor_that_has_fallen_out_ends_the_heat():
    plant = known()
    fell_s, there_c = plant.t_s, plant.water_c
    plant.shows = lambda _: 22.0 + (there_c - 22.0) * math.exp(-(plant.t_s - fell_s) / 60.0)
    began_c = plant.water_c
    plant.run(900, 1.0)
    assert plant.supervisor.state is State.LATCHED
    assert plant.water_c < began_c + 8.0


def test_a_gap_of_which_the_power_is_unknown_ends_a_question():
    plant = known()
    plant.does = lambda power: 0.0
    while not plant.watch.asks:
        plant.run(1, 0.6)
    plant.watch.observe(plant.t_s + 600.0, 600.0, plant.water_c, 0.0)
    assert not plant.watch.asks


# -- parts ---------------------------------------------------------------------------------------


def test_gain_and_lag_are_learnt_from_powers_that_move_whatever_drifts():
    rng, response = np.random.default_rng(5), HeatResponse()
    first = second = heat_s = 0.0
    for n in range(500):
        power = 0.8 if n % 60 < 30 else 0.1
        first += -math.expm1(-4.0 / 22.5) * (power - first)
        second += -math.expm1(-4.0 / 22.5) * (first - second)
        heat_s += 4.0 * second
        reading_c = 20.0 + 0.02 * heat_s - 0.004 * 4.0 * n + 0.01 * rng.standard_normal()
        response.observe(Block(4.0, power, reading_c, 0.01), learn=True)
    gain = response.gain
    assert gain.lag_s == 45.0
    assert abs(gain.mean - 0.02) < 3.0 * gain.sd < 0.004


def quick(n, beta, cools_per_s, lag_s, seed=1):
    """Return what `n` blocks of a plant teach that cools within minutes, held by proportion."""
    rng, response = np.random.default_rng(seed), HeatResponse()
    first = second = power = above_k = 0.0
    for _ in range(n):
        for _ in range(8):
            first += -math.expm1(-1.0 / lag_s) * (power - first)
            second += -math.expm1(-1.0 / lag_s) * (first - second)
            above_k += 0.5 * (beta * second - cools_per_s * above_k)
        shown = 23.0 + above_k + 0.03 * rng.standard_normal()
        response.observe(Block(4.0, power, shown, 0.03), learn=True)
        power = min(max(0.5 + 0.1 * (50.0 - shown), 0.0), 1.0)
    return response.gain


@pytest.mark.parametrize("lag_s", [4.0, 10.0, 13.0, 20.0])
@pytest.mark.parametrize("cools_per_s", [1 / 80, 1 / 110, 1 / 150])
def test_the_gain_of_a_plant_that_cools_within_minutes_is_that_of_its_heater(lag_s, cools_per_s):
    gain = quick(50, 0.5, cools_per_s, lag_s)
    assert abs(gain.mean / 0.5 - 1.0) < 0.15
    assert abs(gain.cools_per_s / cools_per_s - 1.0) < 0.35


def test_a_heater_that_dies_is_not_taken_for_a_plant_that_cools():
    rng, response = np.random.default_rng(2), HeatResponse()
    first = second = 0.0
    y = 25.0
    for n in range(60):
        first += -math.expm1(-4.0 / 13.0) * ((n < 40) - first)
        second += -math.expm1(-4.0 / 13.0) * (first - second)
        y += 4.0 * 0.04 * second
        response.observe(Block(4.0, 1.0, y + 0.01 * rng.standard_normal(), 0.01), learn=n < 44)
    assert response.gain.cools_per_s < 1e-3
    assert abs(response.gain.mean / 0.04 - 1.0) < 0.15


@pytest.mark.parametrize(("dip_k", "mixes_s", "falls_s"), [(1.5, 10.0, 3.0), (1.0, 20.0, 4.0)])
def test_water_that_mixes_under_full_power_is_no_gain(dip_k, mixes_s, falls_s):
    rng, response = np.random.default_rng(1), HeatResponse()
    first = second = 0.0
    y = 37.5
    for n in range(1100):
        t_s, power = 4.0 * (n - 1000), 0.15 + 0.03 * rng.standard_normal() if n < 1000 else 1.0
        first += -math.expm1(-0.4) * (power - first)
        second += -math.expm1(-0.4) * (first - second)
        y += 4.0 * 3e-4 * (second - 0.15)
        shown = y + 0.01 * rng.standard_normal()
        if t_s >= 0.0:  # a cold jug falls past the sensor, and is stirred in
            shown -= 0.2 * -math.expm1(-t_s / falls_s)
            shown -= dip_k * (math.exp(-t_s / mixes_s) - math.exp(-t_s / falls_s))
        response.observe(Block(4.0, power, shown, 0.01), learn=True)
        assert response.gain is None or response.gain.mean < max(1e-3, 5.0 * response.gain.sd), n


def rows(beta, drift, n=40, place=2, seed=3, bend=0.0):
    """Return readings with power for half of the time, and without for the rest."""
    rng = np.random.default_rng(seed)
    response, seen = HeatResponse(), []
    for k in range(n):
        response.observe(Block(4.0, 1.0 if k < n // 2 else 0.0, 20.0, 0.01), learn=False)
        t_s, heat_s = 4.0 * k, float(response.heat_s[place])
        reading_c = 20.0 + drift * t_s + bend * t_s**2 + beta * heat_s
        seen.append(Seen(t_s, reading_c + 0.005 * rng.standard_normal(), response.heat_s))
    return seen


@pytest.mark.parametrize("drift", [-0.01, 0.0, 0.01])
@pytest.mark.parametrize("bend", [-2e-5, 0.0, 2e-5])
@pytest.mark.parametrize(
    ("beta", "answer"),
    [(0.03, Answer.HEATS), (0.0, Answer.NOTHING), (-0.03, Answer.COOLS)],
)
def test_a_question_is_answered_whatever_drifts(beta, answer, drift, bend):
    found = contrast(rows(beta, drift, bend=bend), 0.005)
    assert of_known(found, Gain(0.03, 0.003, 2))[0] is answer
    assert of_unknown(found, 0.02, drift)[0] is answer


def test_a_gain_below_the_resolution_is_no_answer():
    found = contrast(rows(0.0, 0.0), 0.005)
    assert of_unknown(found, 6e-5, 0.0)[0] is Answer.OPEN
    assert contrast(rows(0.0, 0.0, n=5), 0.005) is None


def test_a_block_has_the_mean_of_its_readings_and_none_without_any():
    blocks = Blocks(1.0)
    made = [blocks.add(1.0, reading_c, 0.5) for reading_c in (20.0, math.nan, 21.0, math.nan)]
    assert made[:3] == [None] * 3
    assert made[3][:3] == (4.0, 0.5, 20.5)
    for _ in range(3):
        blocks.add(1.0, math.nan, 1.0)
    assert math.isnan(blocks.add(1.0, math.nan, 1.0).reading_c)


def test_equal_readings_are_a_fault_only_where_noise_is_larger_than_a_step():
    rng = np.random.default_rng(7)
    fine, coarse = StuckSensor(), StuckSensor()
    for n in range(5000):
        water_c = 37.0 + 0.1 * math.sin(n / 300.0)
        noise_k = 0.02 * rng.standard_normal()
        assert not fine.observe(round((water_c + noise_k) / 0.015) * 0.015)
        assert not coarse.observe(round((water_c + noise_k) / 0.488) * 0.488)
    stuck = [fine.observe(37.02) for _ in range(60)]
    assert 10 <= stuck.index(True) <= 40
    assert not any(coarse.observe(37.088) for _ in range(600))


@pytest.mark.parametrize("noise", [0.05, 0.16, 0.3])
def test_a_quiet_converter_between_two_steps_flickers_and_proves_nothing(noise):
    rng, sensor = np.random.default_rng(7), StuckSensor()
    for n in range(6000):
        steps = min(n, 200) + 0.5 - (0.5 * (n > 4000))  # on its way, between two, on one of them
        assert not sensor.observe(0.0625 * round(steps + noise * rng.standard_normal()))


# -- configuration -------------------------------------------------------------------------------

LOOP = {"setpoint_c": 37.5, "trip_above_c": 60.0}


def plan(**keys):
    return plan_for(load({"loops": {"tank": LOOP | keys}}).loops["tank"])


def test_a_loop_is_checked_unless_it_says_otherwise():
    assert plan().heater_check == HeaterCheck()
    assert plan(heater_check={"enabled": False}).heater_check is None
    assert plan(controller={"kind": "pid", "action": "cool"}).heater_check.action == "cool"


@pytest.mark.parametrize(
    ("key", "value"),
    [("weakest_k_per_s", 0.0), ("weakest_k_per_s", 2.0), ("first_heat_s", 1.0), ("wekaest", 1.0)],
)
def test_a_bad_option_is_refused_by_its_name(key, value):
    with pytest.raises(ConfigError, match=key):
        plan(heater_check={key: value})


@pytest.mark.parametrize(
    "keys", [{"weakest_k_per_s": math.nan}, {"first_heat_s": 0.0}, {"action": "warm"}]
)
def test_a_check_that_makes_no_sense_is_refused(keys):
    with pytest.raises(ValueError, match=next(iter(keys))):
        HeaterCheck(**keys)
