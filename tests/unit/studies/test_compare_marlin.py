"""A predictive law in the manner of Marlin's: its model, its constants, what it does."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from thermoctl.app.commands.compare import contender
from thermoctl.app.plugins import BadOption
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.plant.lab import LabParameters
from thermoctl.plant.parameters import Supply, TankParameters
from thermoctl.plant.tank import Tank
from thermoctl.ports import Situation
from thermoctl.signals import Estimate
from thermoctl.studies.compare.baselines import options_for, simc
from thermoctl.studies.compare.bounds import bounds
from thermoctl.studies.compare.labs import lab_rest
from thermoctl.studies.compare.marlin import HOT_END, MarlinMpc, Modelled, options, tuned
from thermoctl.studies.compare.plants import plant
from thermoctl.studies.compare.play import play
from thermoctl.studies.compare.scenarios import SCENARIOS
from thermoctl.studies.compare.score import measured

_, TABLE = load(profile("aquarium")).loop()
RIG, LAB = TankParameters(), LabParameters()
LAW = MarlinMpc(100.0, 200.0, 0.2, 0.5, ambient_least_k_per_s=0.05, steady_k_per_s=0.1)


def seen(reading_c, applied=0.0, setpoint_c=50.0, interval_s=1.0):
    nothing = np.zeros(0)
    belief = Estimate(nothing, np.zeros((0, 0)))
    return Situation(0.0, interval_s, reading_c, setpoint_c, applied, belief, nothing, nothing)


class Hot:
    """A block just as the model has it, in a room at `room_c`."""

    def __init__(self, law, room_c=22.0, more_w=0.0):
        self.law, self.room_c, self.more_w = law, room_c, more_w
        self.block_c = self.sensor_c = room_c

    def live(self, power):
        law = self.law
        lost_w = law.loss_w_per_k * (self.block_c - self.room_c) - self.more_w
        self.block_c += (power * law.heater_w - lost_w) / law.block_j_per_k
        self.sensor_c += law.sensor_per_s * (self.block_c - self.sensor_c)


def held(law, hot, seconds, setpoint_c=50.0):
    """Return the model after it has steered `hot`, and the block's way."""
    belief, power, way_c = law.start(), 0.0, []
    for _ in range(seconds):
        belief = law.observe(belief, seen(hot.sensor_c, power, setpoint_c))
        belief, power = law.decide(belief, seen(hot.sensor_c, power, setpoint_c))
        hot.live(power)
        way_c.append(hot.block_c)
    return belief, np.array(way_c)


# -- the model -------------------------------------------------------------------------------------


def test_a_block_that_is_as_modelled_is_followed_to_the_last_bit_while_it_heats():
    hot, belief = Hot(LAW), LAW.observe(LAW.start(), seen(22.0))
    for _ in range(40):
        hot.live(1.0)
        belief = LAW.observe(belief, seen(hot.sensor_c, 1.0))
    assert belief.block_c == pytest.approx(hot.block_c, abs=1e-9)
    assert belief.ambient_c == pytest.approx(22.0)


def test_the_surroundings_take_up_what_is_wrong_with_the_model():
    hot = Hot(LAW, more_w=8.0)
    belief, way_c = held(LAW, hot, 900)
    assert belief.ambient_c == pytest.approx(22.0 + 8.0 / LAW.loss_w_per_k, abs=1.0)
    assert np.mean(way_c[-200:]) == pytest.approx(50.0, abs=0.05)


def test_the_power_brings_the_block_there_in_two_seconds_and_makes_up_for_the_loss():
    near = Modelled(49.5, 49.5, 20.0)
    _, power = LAW.decide(near, seen(49.5))
    assert power == pytest.approx((0.5 * 200.0 / 2.0 + 0.5 * 29.5) / 100.0)
    _, holding = LAW.decide(Modelled(50.0, 50.0, 20.0), seen(50.0))
    assert holding == pytest.approx(0.15)
    assert LAW.decide(Modelled(20.0, 20.0, 20.0), seen(20.0))[1] == 1.0
    assert LAW.decide(Modelled(60.0, 60.0, 20.0), seen(60.0))[1] == 0.0


def test_part_of_what_the_sensor_reads_beside_the_model_is_taken_over():
    at_rest = Modelled(50.0, 50.0, 50.0)
    after = LAW.observe(at_rest, seen(50.4, 0.0))
    assert after.block_c == pytest.approx(50.2)
    assert after.sensor_c == pytest.approx(50.2)
    calm = replace(LAW, smoothing=0.1).observe(at_rest, seen(50.4, 0.0))
    assert calm.block_c == pytest.approx(50.04)


def test_the_surroundings_are_left_alone_while_it_heats_at_full_power():
    rising = Modelled(30.0, 28.0, 22.0)
    assert LAW.observe(rising, seen(29.0, 1.0)).ambient_c == 22.0
    assert LAW.observe(rising, seen(29.0, 0.9)).ambient_c > 22.0


def test_surroundings_that_move_at_all_move_by_the_least_step():
    at_rest = Modelled(50.0, 50.0, 50.0)
    up, down = (LAW.observe(at_rest, seen(50.0 + off)).ambient_c for off in (1e-6, -1e-6))
    assert (up, down) == pytest.approx((50.05, 49.95))


def test_a_block_that_is_hot_when_it_begins_does_not_stand_in_a_room_as_hot():
    assert LAW.observe(LAW.start(), seen(80.0)) == Modelled(80.0, 80.0, 30.0)
    assert LAW.observe(LAW.start(), seen(12.0)) == Modelled(12.0, 12.0, 12.0)


def test_without_a_reading_it_asks_for_nothing_and_believes_what_it_did():
    belief = Modelled(50.0, 50.0, 22.0)
    assert LAW.observe(belief, seen(math.nan)) == belief
    assert math.isnan(LAW.decide(belief, seen(math.nan))[1])


# -- its constants ---------------------------------------------------------------------------------


def auto_tuned(times_s, readings_c, heater_w):
    """Return capacity and responsiveness as Marlin's differential tuning has them."""
    rates = np.gradient(readings_c, times_s)
    fastest = int(np.argmax(rates))
    rate, at_s, at_c = rates[fastest], times_s[fastest], readings_c[fastest]
    return heater_w / rate, rate / (rate * at_s + readings_c[0] - at_c)


def test_auto_tune_on_the_rig_would_find_about_these_constants():
    still = replace(RIG, supply=Supply(voltage_spread=0.0, loss_spread=0.0), initial_c=25.0,
                    probe=replace(RIG.probe, turbulence_k=0.0))  # fmt: skip
    tank, readings_c = Tank(still, np.random.default_rng(0)), [25.0]
    for _ in range(240):
        tank.advance(1.0, 1.0)
        readings_c.append(tank.sensor_c)
    capacity, per_s = auto_tuned(np.arange(241.0), np.array(readings_c), 1500.0)
    print(capacity, per_s, tuned(RIG))
    # The ice takes a seventh of the power meanwhile, which looks like more water.
    assert tuned(RIG).block_j_per_k == pytest.approx(capacity, rel=0.2)
    assert tuned(RIG).sensor_per_s == pytest.approx(per_s, rel=0.2)


def test_the_constants_of_a_lab_close_its_balance_at_the_set_point():
    rig = tuned(LAB, 50.0)
    assert (rig.heater_w, rig.block_j_per_k, rig.sensor_per_s) == pytest.approx((1.0, 2.0, 1 / 9))
    assert rig.loss_w_per_k * 27.0 == pytest.approx(lab_rest(LAB, 50.0).power)


def test_the_hot_end_of_marlin_has_the_speeds_of_marlin():
    assert HOT_END.speeds() == pytest.approx({"ambient_least_k_per_s": 1.0, "steady_k_per_s": 0.5})


def test_an_option_that_is_given_counts_and_the_others_are_those_of_the_fleet():
    law = contender("marlin-mpc:horizon_s=6.0", TABLE).plan_for(plant("tclab", 1)).controller
    assert law == MarlinMpc(**options(tuned(LAB, 50.0)), horizon_s=6.0)
    on_rig = contender("marlin-mpc", TABLE).plan_for(plant("rig", 1)).controller
    assert on_rig == MarlinMpc() == MarlinMpc(**options(tuned(RIG)))


def test_nobody_is_told_the_plant_he_meets_but_its_nameplate():
    assert options_for("marlin-mpc", plant("tclab", 1)) == options_for(
        "marlin-mpc", plant("tclab", 2)
    )
    where = plant("sizes", 3)
    told = contender("marlin-mpc", TABLE, nameplate=True).plan_for(where).controller
    assert told.heater_w == where.parameters.element.rated_w
    assert told.block_j_per_k == pytest.approx(4181.0 * where.parameters.vessel.water_kg)
    assert contender("marlin-mpc", TABLE).plan_for(where).controller == MarlinMpc()


def test_simple_pid_has_the_gains_of_the_lab_on_a_lab():
    gains = simc(LAB)
    assert options_for("simple-pid", plant("tclab", 1)) == {"Kp": gains.Kp, "Ki": gains.Ki}
    # .5 K/s, 9 s of sensor of which half is dead time, half a second of sampling.
    assert gains.Kp == pytest.approx(1.0 / (0.5 * 2.0 * 5.0), rel=0.05)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("marlin-mpc:smoothing=1.5", "at most 1, got 1.5"),
        ("marlin-mpc:horizon_s=0.0", "a number above 0, got 0"),
        ("marlin-mpc:horizon=2", "unknown key"),
    ],
)
def test_a_bad_constant_is_refused_by_name(text, words):
    with pytest.raises(BadOption, match=words):
        contender(text, TABLE)


# -- on the plants ---------------------------------------------------------------------------------


def run(fleet, seed, name):
    where, scenario = plant(fleet, seed), SCENARIOS[name]
    trace = play(contender("marlin-mpc", TABLE).plan_for(where), where, scenario)
    assert trace.failure is None
    return measured(trace), bounds(where, scenario)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_it_warms_the_rig_up_and_holds_it(seed):
    warm, bound = run("rig", seed, "warm-up")
    held_there, least = run("rig", seed, "regulation")
    print(warm, held_there)
    assert warm["overshoot_k"] < 0.08
    assert warm["settled_s"] < 1.25 * bound["settled_s"]
    assert held_there["largest_k"] < 0.1
    assert held_there["deviation_k"] < 2.0 * least["deviation_k"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_it_holds_a_lab_within_a_quarter_of_a_kelvin(seed):
    figures, _ = run("tclab", seed, "regulation")
    print(figures)
    assert figures["largest_k"] < 0.25
    assert abs(figures["bias_k"]) < 0.02


def test_its_constants_are_all_options():
    assert set(options(tuned(RIG))) < set(asdict(MarlinMpc()))
