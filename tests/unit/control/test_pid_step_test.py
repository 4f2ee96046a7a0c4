"""Learning a plant from the first warm-up."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from thermoctl.control.pid import Pid
from thermoctl.control.pid.simc import Gains, Process, simc
from thermoctl.control.pid.step_fit import ANY, step_fit
from thermoctl.control.pid.stretch import PIECES_MAX, Piece, Stretch
from thermoctl.estimation import start
from thermoctl.ports import Situation
from thermoctl.signals import Beliefs

NO_PAST = np.empty(0)
GIVEN = Gains(0.1, 600.0)


@dataclass
class Vessel:
    """Water that gains `slope` K/s at full power behind dead time and a lag, and loses some."""

    slope: float = 0.04
    dead_s: int = 5
    lag_s: float = 12.0
    loss: float = 0.006
    noise_k: float = 0.005
    water_c: float = 20.0
    heat: float = 0.0
    past: list = field(default_factory=list)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    def advance(self, power, seconds=1):
        for _ in range(seconds):
            self.past.append(power)
            late = self.past[-1 - self.dead_s] if len(self.past) > self.dead_s else 0.0
            before = self.heat
            self.heat += (late - self.heat) * -math.expm1(-1.0 / self.lag_s)
            rise = late - self.lag_s * (self.heat - before)  # the integral of the heat, exactly
            self.water_c += self.slope * rise - self.loss
        return self.water_c + self.noise_k * self.rng.normal()


class Loop:
    """A law and its vessel, a sample at a time."""

    def __init__(self, law, vessel, setpoint_c=40.0):
        self.law, self.vessel, self.setpoint_c = law, vessel, setpoint_c
        self.belief, self.reading_c, self.power, self.t_s = law.start(), vessel.advance(0.0), 0.0, 0
        self.said = {}

    def situation(self, seconds=1):
        return Situation(float(self.t_s), float(seconds), self.reading_c, self.setpoint_c,
                         self.power, start(1), NO_PAST, NO_PAST, self.reading_c)  # fmt: skip

    def sample(self, seconds=1, given=None, *, asks=False):
        """Let a sample pass; who gives `given` is in charge, the law in shadow if it `asks`."""
        situation = self.situation(seconds)
        self.belief = self.law.observe(self.belief, situation)
        asked = given
        if given is None or asks:
            self.belief, wanted = self.law.decide(self.belief, situation)
            asked = wanted if given is None else given
        for name, text in self.law.remarks(self.belief).items():
            self.said.setdefault(name, (self.t_s, text))
        self.power = min(max(asked, 0.0), 1.0)
        self.reading_c = self.vessel.advance(self.power, seconds)
        self.t_s += seconds

    def until(self, *names, most_s=7200):
        while not any(name in self.said for name in names):
            assert self.t_s < most_s, self.said
            self.sample()
        return self.law.gains(self.belief)


def warmed(vessel, powers):
    stretch = Stretch()
    for power in powers:
        stretch = stretch.after(Piece(1.0, power, vessel.advance(power)))
    return stretch


# -- the fit ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("slope", [0.004, 0.04, 0.4])
@pytest.mark.parametrize(("dead_s", "lag_s"), [(5, 12.0), (12, 12.0), (20, 5.0), (3, 8.0)])
def test_the_fit_finds_the_plant_that_made_the_rise(slope, dead_s, lag_s):
    vessel = Vessel(slope, dead_s, lag_s, 0.15 * slope, noise_k=0.001 * slope)
    fit = step_fit(warmed(vessel, [1.0] * int(6.0 * (dead_s + lag_s))))
    process = fit.process
    assert fit.total_s == pytest.approx(dead_s + lag_s, rel=0.15)
    assert process.slope_k_per_s == pytest.approx(slope, rel=0.1)
    true = simc(Process(slope, dead_s, (math.inf, lag_s)))
    assert simc(process).gain_per_k == pytest.approx(true.gain_per_k, rel=0.15)


def test_the_power_that_was_applied_may_be_anything():
    powers = np.random.default_rng(3).uniform(0.2, 1.0, 12).repeat(15)
    fit = step_fit(warmed(Vessel(), powers))
    assert fit.total_s == pytest.approx(17.0, rel=0.1)
    assert fit.process.slope_k_per_s == pytest.approx(0.04, rel=0.1)


def test_readings_that_are_missing_are_left_out():
    whole = warmed(Vessel(noise_k=0.0), [1.0] * 120)
    rng = np.random.default_rng(8)
    holed = Stretch()
    for piece in whole.pieces:
        reading_c = math.nan if rng.random() < 0.4 else piece.reading_c
        holed = holed.after(Piece(piece.length_s, piece.power, reading_c))
    assert step_fit(holed).total_s == pytest.approx(step_fit(whole).total_s, rel=0.02)


@pytest.mark.parametrize("vessel", [Vessel(slope=-0.04, loss=0.0), Vessel(0.0, noise_k=0.0)])
def test_a_plant_that_power_does_not_warm_has_no_fit(vessel):
    assert step_fit(warmed(vessel, [1.0] * 200)) is None


def test_a_few_readings_are_not_enough():
    assert step_fit(warmed(Vessel(), [1.0] * 7)) is None


@pytest.mark.parametrize("power", [0.0, 0.25, 0.5, 1.0])
def test_the_end_of_power_tells_the_lag_whatever_was_before_the_first_reading(power):
    vessel = Vessel()
    vessel.advance(power, 60)
    stretch = warmed(vessel, [1.0] * 60 + [0.0] * 70)
    assert step_fit(stretch, ANY).total_s == pytest.approx(17.0, rel=0.15)


def test_of_full_power_that_goes_on_every_lag_is_as_true_as_another():
    vessel = Vessel()
    vessel.advance(1.0, 60)
    stretch = warmed(vessel, [1.0] * 100)
    assert step_fit(stretch).total_s < 2.0
    assert step_fit(stretch, ANY).total_s > 10.0


def test_a_stretch_tells_for_how_long_there_has_been_less_power():
    powers = [0.0, 0.3, 1.0, 0.2, 0.4, 0.1]
    assert warmed(Vessel(), powers).since_s(0.5) == 3.0
    assert warmed(Vessel(), [*powers, 0.5]).since_s(0.5) == 0.0
    assert Stretch().since_s(0.5) == 0.0


def test_a_stretch_is_bounded_and_forgets_neither_time_nor_energy():
    rng = np.random.default_rng(2)
    stretch, pieces = Stretch(), [Piece(1.0, power, 20.0) for power in rng.random(5000)]
    for piece in pieces:
        stretch = stretch.after(piece)
        assert len(stretch.pieces) <= PIECES_MAX
    assert stretch.length_s == pytest.approx(5000.0)
    assert stretch.given_s()[-1] == pytest.approx(sum(piece.power for piece in pieces))
    assert len(stretch.pieces) > PIECES_MAX // 4


# -- the test --------------------------------------------------------------------------------------


def test_a_warm_up_tunes_and_the_set_point_is_reached():
    loop = Loop(Pid(), Vessel())
    gains = loop.until("controller.tuned")
    true = simc(Process(0.04, 5.5, (math.inf, 12.0)))
    assert gains.gain_per_k == pytest.approx(true.gain_per_k, rel=0.15)
    assert gains.integral_s == pytest.approx(true.integral_s, rel=0.25)
    assert loop.vessel.water_c < 20.0 + 0.5 * 20.0 + 0.5
    assert loop.said["controller.tuning"][0] == 0
    assert f"gain {gains.gain_per_k:.3g} per K" in loop.said["controller.tuned"][1]
    for _ in range(1200):
        loop.sample()
    assert loop.vessel.water_c == pytest.approx(40.0, abs=0.05)


def test_the_tuned_form_may_have_a_derivative():
    gains = Loop(Pid(tuned_form="pid"), Vessel()).until("controller.tuned")
    assert gains.derivative_s == pytest.approx(10.0, rel=0.4)
    assert gains.gain_per_k > 1.2


def test_its_power_is_full_at_most_half_the_way_and_then_none_until_the_lag_is_known():
    loop = Loop(Pid(), Vessel(slope=0.8, loss=0.01, dead_s=8, lag_s=10.0))
    while loop.vessel.water_c < 30.0:
        loop.sample()
        assert loop.power == 1.0
    loop.sample()
    assert loop.power == 0.0
    gains = loop.until("controller.tuned")
    assert gains.gain_per_k == pytest.approx(0.5 / (0.8 * 13.5), rel=0.3)


@pytest.mark.parametrize("seconds", [1, 2, 5])
def test_the_period_may_be_long(seconds):
    loop = Loop(Pid(period_s=float(seconds)), Vessel())
    while "controller.tuned" not in loop.said:
        loop.sample(seconds)
        assert loop.t_s < 600
    true = simc(Process(0.04, 5.0 + 0.5 * seconds, (math.inf, 12.0)))
    assert loop.law.gains(loop.belief).gain_per_k == pytest.approx(true.gain_per_k, rel=0.25)


def test_what_was_learnt_of_the_plant_is_believed():
    loop = Loop(Pid(), Vessel())
    assert loop.law.beliefs(loop.belief, loop.situation()) == Beliefs()
    loop.until("controller.tuned")
    assert loop.law.beliefs(loop.belief, loop.situation()).gain == pytest.approx(0.04, rel=0.1)


def test_near_the_set_point_nothing_is_tested_and_the_gains_are_as_given():
    loop = Loop(Pid(), Vessel(water_c=38.0))
    for _ in range(600):
        loop.sample()
    assert loop.said == {}
    assert loop.law.gains(loop.belief) == GIVEN


def test_nothing_is_tested_while_somebody_else_steers():
    loop = Loop(Pid(), Vessel())
    for _ in range(100):
        loop.sample(given=0.0)
    assert loop.said == {}
    loop.sample()
    assert "controller.tuning" in loop.said


def test_a_test_that_somebody_interrupts_begins_anew():
    loop = Loop(Pid(), Vessel())
    for _ in range(40):
        loop.sample()
    for _ in range(40):
        loop.sample(given=0.1)
    assert loop.law.remarks(loop.belief) == {}
    gains = loop.until("controller.tuned")
    true = simc(Process(0.04, 5.5, (math.inf, 12.0)))
    assert gains.gain_per_k == pytest.approx(true.gain_per_k, rel=0.4)


def test_readings_missing_for_a_moment_do_not_end_it():
    loop = Loop(Pid(), Vessel())
    for _ in range(60):
        loop.sample()
    for _ in range(10):
        loop.reading_c = math.nan
        loop.sample(given=1.0)  # as a supervisor holds it
    loop.until("controller.tuned", most_s=300)


def test_a_heater_that_does_nothing_is_given_up_after_the_time_limit():
    loop = Loop(Pid(tuning_limit_s=900.0), Vessel(slope=0.0, loss=0.0))
    assert loop.until("controller.tuned", "controller.tuning_failed") == GIVEN
    at_s, text = loop.said["controller.tuning_failed"]
    assert 900 <= at_s <= 902
    assert "900 s" in text
    loop.sample()
    assert "controller.tuning" not in loop.law.remarks(loop.belief)


def test_a_lag_that_does_not_show_is_given_up_without_power():
    loop = Loop(Pid(), Vessel(slope=20.0, loss=0.0, dead_s=0, lag_s=600.0))
    assert loop.until("controller.tuned", "controller.tuning_failed") == GIVEN
    assert "lag did not show" in loop.said["controller.tuning_failed"][1]


# -- a test that begins in the middle of a warm-up -------------------------------------------------


def warming(before_s, setpoint_c=40.0):
    """Return a loop that begins after full power for `before_s`, of which nobody told it."""
    vessel = Vessel(water_c=24.0)
    vessel.advance(1.0, before_s)
    return Loop(Pid(), vessel, setpoint_c)


def losing(loop):
    """Let the loss grow with the temperature, as that of water does."""
    loop.vessel.loss = 0.006 + 0.0005 * (loop.vessel.water_c - 24.0)


@pytest.mark.parametrize("before_s", [8, 12, 20, 30, 45, 60, 150, 250])
def test_begun_in_the_middle_of_a_warm_up_it_waits_for_the_end_of_power_to_tell_the_lag(before_s):
    loop = warming(before_s)
    while "controller.tuned" not in loop.said:
        losing(loop)
        loop.sample()
        assert loop.t_s < 600
    gains = loop.law.gains(loop.belief)
    true = simc(Process(0.04, 5.5, (math.inf, 12.0)))
    assert true.gain_per_k / 1.5 < gains.gain_per_k < 2.0 * true.gain_per_k
    for _ in range(2000):
        losing(loop)
        loop.sample()
        assert loop.vessel.water_c < 40.5
    assert loop.vessel.water_c == pytest.approx(40.0, abs=0.05)


def test_begun_in_the_middle_of_a_warm_up_its_power_is_full_at_most_half_the_way_that_is_left():
    loop = warming(150)
    begun_c = loop.reading_c
    while loop.reading_c - begun_c < 0.5 * (40.0 - begun_c):
        loop.sample()
        assert loop.power == 1.0
        assert "controller.tuned" not in loop.said
    loop.sample()
    assert loop.power == 0.0
    loop.until("controller.tuned", most_s=loop.t_s + 120)


def test_in_the_shadow_of_a_warm_up_it_learns_when_the_other_takes_the_power_away():
    loop = warming(60)
    while loop.vessel.water_c < 38.5:
        loop.sample(given=1.0, asks=True)
        assert "controller.tuned" not in loop.said
    while "controller.tuned" not in loop.said:
        loop.sample(given=0.15, asks=True)
        assert loop.t_s < 600
    true = simc(Process(0.04, 5.5, (math.inf, 12.0)))
    assert loop.law.gains(loop.belief).gain_per_k == pytest.approx(true.gain_per_k, rel=0.4)
