"""The lab as a plant to compare on: its rest, its bounds, its fleet."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.app.commands.compare import contender
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.control.manual import Manual
from thermoctl.model.sensor import TMP36
from thermoctl.plant import lab
from thermoctl.plant.acquisition import Acquisition
from thermoctl.plant.lab import LabHeat, LabParameters, TemperatureLab
from thermoctl.regulator.heater.check import HeaterCheck, weakest_of
from thermoctl.studies.compare.bounds import bounds
from thermoctl.studies.compare.labs import KnownLab, lab_rest, linear_lab
from thermoctl.studies.compare.linear import reading_variance
from thermoctl.studies.compare.plants import FLEETS, LAB_ACQUISITION, Plant, plant
from thermoctl.studies.compare.play import play
from thermoctl.studies.compare.riccati import lyapunov, regulated, riccati
from thermoctl.studies.compare.run import Contender, finished, jobs_for
from thermoctl.studies.compare.scenarios import SCENARIOS, Happening
from thermoctl.studies.compare.score import measured
from thermoctl.studies.compare.stand import stand_for
from thermoctl.studies.compare.store import Store
from thermoctl.studies.compare.swift import swiftest

LAB = LabParameters()
QUIET = replace(LAB, room_spread_k=0.0)
NOMINAL = Plant("tclab", 0, LAB, LAB_ACQUISITION, usage=FLEETS["tclab"].usage)
_, TABLE = load(profile("aquarium")).loop()


def held(power):
    plan = contender("on-off", TABLE).plan_for(NOMINAL)
    return replace(plan, controller=Manual(power))


# -- rest and linear plant -------------------------------------------------------------------------


def test_a_lab_at_rest_stays_there():
    at, known = lab_rest(LAB, 50.0), KnownLab(LAB)
    heat = at.heat
    for _ in range(1000):
        heat = known.advance(heat, at.power)
    assert heat[:2] == pytest.approx((50.0, at.heat.second_c), abs=1e-9)
    assert 0.4 < at.power < 0.55
    assert 23.0 < at.heat.second_c < 30.0


def test_no_power_holds_what_is_beyond_full_power_or_below_the_room():
    for target_c in (90.0, 10.0):
        with pytest.raises(ValueError, match="expected a power from 0 to 1"):
            lab_rest(LAB, target_c)


def test_a_little_more_power_does_to_the_linear_lab_what_it_does_to_the_lab():
    at, known = lab_rest(LAB, 50.0), KnownLab(LAB)
    linear = linear_lab(LAB, LAB_ACQUISITION, at)
    x, more = np.zeros((4, 1)), at.heat
    for _ in range(90):
        x = linear.A @ x + 0.02 * linear.B
        more = known.advance(more, at.power + 0.02)
    assert (linear.z @ x).item() == pytest.approx(more.first_c - 50.0, rel=5e-3)


def test_the_linear_sensor_follows_as_the_sensor_of_the_lab():
    one, at = TemperatureLab(QUIET, np.random.default_rng(0)), lab_rest(QUIET, 30.0)
    linear, x = linear_lab(QUIET, LAB_ACQUISITION, at), np.array([[-7.0], [0.0], [0.0], [-7.0]])
    x[1] = 23.0 - at.heat.second_c
    for _ in range(30):
        one.advance(1.0, 0.3)
        x = linear.A @ x + (0.3 - at.power) * linear.B
    assert (linear.C @ x).item() + 30.0 == pytest.approx(one.sensor_c, abs=0.02)
    assert (linear.z @ x).item() + 30.0 == pytest.approx(one.temperature_c, abs=0.02)


def test_the_room_shakes_the_linear_lab_as_it_shakes_the_lab():
    at = lab_rest(LAB, 50.0)
    linear = linear_lab(LAB, LAB_ACQUISITION, at)
    expected_k = math.sqrt((linear.z @ lyapunov(linear.A, linear.Q) @ linear.z.T).item())
    off_k = []
    for seed in range(4):
        one = TemperatureLab(LAB, np.random.default_rng(seed))
        one.advance(1500.0, at.power)
        for _ in range(3000):
            one.advance(2.0, at.power)
            off_k.append(one.temperature_c - 50.0)
    print(f"{1e3 * np.std(off_k):.1f} mK, expected {1e3 * expected_k:.1f}")
    assert np.sqrt(np.mean(np.square(off_k))) == pytest.approx(expected_k, rel=0.2)


def test_a_reading_at_rest_is_as_restless_as_the_linear_lab_has_it():
    converter = Acquisition(LAB_ACQUISITION, np.random.default_rng(4))
    rng, sds = np.random.default_rng(5), []
    for level_c in 50.0 + rng.random(20):
        volts = TMP36.volts(level_c)
        counts = np.array([converter.convert(volts) for _ in range(200)])
        seen_c = TMP36.temperature_c(5.0 * counts / LAB_ACQUISITION.full_scale)
        sds.append(np.mean((seen_c - level_c) ** 2))
    assert np.mean(sds) == pytest.approx(reading_variance(LAB_ACQUISITION), rel=0.1)


# -- bounds ----------------------------------------------------------------------------------------


def test_a_lone_heater_without_radiation_arrives_when_an_exponential_does():
    plain = replace(QUIET, emissivity=0.0, between_m2=0.0)
    way = swiftest(KnownLab(plain), lab.start(plain), 50.0)
    # 2 J/K over 10 mW/K, and 100 K at full power.
    assert way.settled_s == pytest.approx(-200.0 * math.log(1.0 - 26.9 / 100.0), abs=0.02)


def test_a_lab_that_would_cool_fast_has_arrived_all_the_same():
    way = swiftest(KnownLab(LAB), lab_rest(LAB, 50.0).heat, 52.5)
    # At 50 degC it rises by .27 K/s at first: it is there before the band is, and then held.
    heat, second = lab_rest(LAB, 50.0).heat, 0
    while heat.first_c < 52.4:
        heat, second = KnownLab(LAB).advance(heat, 1.0), second + 1
    assert second - 1 < way.settled_s <= second


def test_a_lab_allows_what_its_physics_allow():
    found = {name: bounds(NOMINAL, SCENARIOS[name]) for name in FLEETS["tclab"].scenarios}
    print(found)
    assert 65.0 < found["warm-up"]["settled_s"] < 80.0
    assert 8.0 < found["step"]["settled_s"] < 13.0
    deviation_k = found["regulation"]["deviation_k"]
    assert 1.0 <= found["regulation"]["realisable_k"] / deviation_k < 1.5
    assert found["second-heater"] == {}


def test_whoever_gives_less_or_later_arrives_no_sooner():
    known, rng = KnownLab(LAB), np.random.default_rng(5)
    best = swiftest(known, lab.start(LAB), 50.0)
    for _ in range(40):
        heat, outside = lab.start(LAB), 0
        switch_s, level = rng.uniform(60.0, 100.0), rng.uniform(0.9, 1.0)
        for second in range(1, 200):
            heat = known.advance(heat, level if second <= switch_s else rng.uniform(0.0, 1.0))
            if abs(heat.first_c - 50.0) > 0.1:
                outside = second
        assert outside >= best.settled_s - 1.0


@pytest.mark.slow
def test_the_law_that_knows_the_lab_reaches_the_bound_on_the_simulated_one():
    at, price = lab_rest(LAB, 50.0), 0.05
    linear = linear_lab(LAB, LAB_ACQUISITION, at)
    expected_k = regulated(linear, price).judged
    P = riccati(linear.A.T, linear.C.T, linear.Q, np.array([[linear.R]]))
    K = P @ linear.C.T / (linear.C @ P @ linear.C.T + linear.R)
    X = riccati(linear.A, linear.B, linear.z.T @ linear.z, np.array([[price]]))
    L = np.linalg.solve(price + linear.B.T @ X @ linear.B, linear.B.T @ X @ linear.A)
    off_k = []
    for seed in range(4):
        rngs = np.random.default_rng(seed).spawn(2)
        one, converter = TemperatureLab(LAB, rngs[0]), Acquisition(LAB_ACQUISITION, rngs[1])
        x = np.zeros((4, 1))
        x[:2, 0] = np.array(lab.start(LAB)[:2]) - at.heat[:2]
        x[3] = x[0]
        for second in range(5000):
            volts = 5.0 * converter.convert(one.volts()) / LAB_ACQUISITION.full_scale
            x = x + K * (TMP36.temperature_c(volts) - 50.0 - linear.C @ x)
            power = min(max(at.power - (L @ x).item(), 0.0), 1.0)
            x = linear.A @ x + linear.B * (power - at.power)
            one.advance(1.0, power)
            if second > 1000:
                off_k.append(one.temperature_c - 50.0)
    print(f"{1e3 * np.std(off_k):.2f} mK, expected {1e3 * expected_k:.2f}")
    assert np.sqrt(np.mean(np.square(off_k))) == pytest.approx(expected_k, rel=0.12)


# -- the fleet -------------------------------------------------------------------------------------


def test_a_seed_is_a_lab_and_its_room_and_noise_are_the_same_for_everyone():
    brief = replace(SCENARIOS["warm-up"], judged_s=30.0)
    first, second = (play(held(0.7), plant("tclab", 5), brief) for _ in range(2))
    assert np.array_equal(first.true_c, second.true_c)
    assert plant("tclab", 5) == plant("tclab", 5)
    assert plant("tclab", 5).parameters != plant("tclab", 6).parameters


@pytest.mark.parametrize("seed", range(40))
def test_every_lab_can_be_held_at_its_set_point_and_at_a_step_above(seed):
    where = plant("tclab", seed)
    assert 0.2 < lab_rest(where.parameters, where.held_c).power < 0.8
    assert lab_rest(where.parameters, where.held_c + 2.5).power < 0.9
    assert 4.0 <= where.parameters.sensor_lag_s <= 20.1


def test_a_lab_is_given_the_limits_and_the_gain_of_its_data_sheet():
    plan = contender("on-off", TABLE).plan_for(plant("tclab", 3))
    assert (plan.limits.trip_above_c, plan.limits.setpoint_max_c) == (80.0, 70.0)
    assert plan.identifier.structure.b_k == pytest.approx(LAB.first_w / LAB.heat_j_per_k)
    rig = contender("on-off", TABLE).plan_for(plant("rig", 3))
    assert rig.limits.trip_above_c == TABLE.trip_above_c


def test_the_heater_of_a_lab_is_checked_as_that_of_a_rig_by_what_it_is_rated():
    law = contender("on-off", TABLE)
    for fleet, heater_w in (("tclab", 1.0), ("rig", TABLE.heater_w)):
        assert law.plan_for(plant(fleet, 3)).heater_check == HeaterCheck(weakest_of(heater_w))


def test_litres_that_are_configured_are_those_of_the_configured_watts():
    law = contender("on-off", TABLE.model_copy(update={"volume_l": 8.0}))
    for fleet, weakest in (
        ("tclab", weakest_of(1.0)),
        ("rig", weakest_of(TABLE.heater_w, 8.0)),
    ):
        assert law.plan_for(plant(fleet, 3)).heater_check == HeaterCheck(weakest)


def test_a_lab_has_settled_within_its_own_band_in_runs_and_in_bounds():
    where = plant("tclab", 3)
    trace = play(held(0.5), where, replace(SCENARIOS["warm-up"], judged_s=5.0))
    assert trace.band_k == where.band_k == 0.15
    off_k = np.where(np.arange(6) < 2, 0.16, 0.14)
    assert measured(replace(trace, true_c=trace.setpoint_c - off_k))["settled_s"] == 2.0
    known, begin = KnownLab(where.parameters), lab.start(where.parameters)
    best = swiftest(known, begin, 50.0, band_k=0.15, peak_k=0.15)
    assert bounds(where, SCENARIOS["warm-up"])["settled_s"] == best.settled_s


def test_a_loop_of_the_users_own_is_left_as_it_is():
    plan = contender("on-off", TABLE, fitted=False).plan_for(plant("tclab", 3))
    assert plan.limits.trip_above_c == TABLE.trip_above_c


def test_the_second_heater_is_turned_on_when_the_judged_stretch_begins():
    scenario = replace(SCENARIOS["second-heater"], judged_s=200.0)
    disturbed = play(held(0.4), NOMINAL, scenario)
    calm = play(held(0.4), NOMINAL, replace(scenario, happenings=()))
    rise_k = disturbed.true_c - calm.true_c
    assert rise_k[0] == 0.0
    assert 1.0 < rise_k[-1] < 5.0


def test_nothing_else_can_befall_a_lab():
    stand = stand_for(NOMINAL, np.random.default_rng(0))
    with pytest.raises(ValueError, match="expected second-heater and a power, got 'ice'"):
        stand.befall("ice", 0.3)


def test_power_of_a_lab_is_set_in_steps_of_eight_bits():
    trace = play(held(0.3337), NOMINAL, replace(SCENARIOS["warm-up"], judged_s=5.0))
    assert trace.power == pytest.approx(np.full(6, round(0.3337 * 255) / 255), abs=1e-12)


def test_runs_on_a_lab_are_kept_and_not_made_twice(tmp_path):
    made = []

    def plan_for(where):
        made.append(where.seed)
        return held(0.5)

    planned = jobs_for([Contender("law", "one", plan_for)], ["tclab"], range(1), ["warm-up"])
    first = [result for _, result in finished(planned, Store(tmp_path / "r"), 1)]
    again = [result for _, result in finished(planned, Store(tmp_path / "r"), 1)]
    assert again == first
    assert made == [0]
    hotter = replace(NOMINAL, usage=replace(NOMINAL.usage, trip_above_c=70.0))
    assert repr(hotter) != repr(NOMINAL)  # which is in the key of a run


def test_what_happens_to_a_lab_says_how_much():
    (happening,) = SCENARIOS["second-heater"].happenings
    assert happening == Happening(0.0, "second-heater", 0.5)
    assert lab.start(LAB) == LabHeat(23.0, 23.0)
