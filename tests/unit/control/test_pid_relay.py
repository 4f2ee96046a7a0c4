"""Learning a plant from the swing a relay makes."""

import cmath
import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from thermoctl.control.pid import Pid
from thermoctl.control.pid.autotune import Found
from thermoctl.control.pid.relay import RelayTest, harmonic_point, integrating_plant, limit_of
from thermoctl.control.pid.simc import Gains, Limit, Process, tyreus_luyben
from thermoctl.control.pid.stretch import Piece, Stretch
from thermoctl.estimation import start
from thermoctl.ports import Situation

NO_PAST = np.empty(0)
SETPOINT_C = 40.0
GIVEN = Gains(0.1, 600.0)


@dataclass
class Plant:
    """An integrator behind dead time and lags, in steps of a tenth of a second; it may leak."""

    slope: float = 0.05
    dead_s: float = 12.0
    lags_s: tuple = ()
    leak_per_s: float = 0.0
    loss: float = 0.01
    water_c: float = 38.0
    states: list = field(default_factory=list)
    past: list = field(default_factory=list)

    def advance(self, power):
        self.states = self.states or [0.0] * len(self.lags_s)
        delay = round(10 * self.dead_s)
        for _ in range(10):
            self.past.append(power)
            signal = self.past[-1 - delay] if len(self.past) > delay else 0.0
            for i, lag_s in enumerate(self.lags_s):
                self.states[i] += (signal - self.states[i]) * -math.expm1(-0.1 / lag_s)
                signal = self.states[i]
            leak = self.leak_per_s * (self.water_c - SETPOINT_C)
            self.water_c += 0.1 * (self.slope * signal - self.loss - leak)
        return self.water_c

    def response(self, omega):
        s = 1j * omega
        whole = self.slope * cmath.exp(-self.dead_s * s) / (s + self.leak_per_s)
        for lag_s in self.lags_s:
            whole /= lag_s * s + 1.0
        return whole

    def limit(self):
        """Return ultimate gain and period, where the phase is half a turn, sampled once a second.

        A power that is held from one sample to the next is half of that late.
        """
        low, high = 1e-4, 2.0
        for _ in range(100):
            middle = 0.5 * (low + high)
            behind = (self.dead_s + 0.5) * middle + math.atan2(middle, self.leak_per_s)
            behind += sum(math.atan(lag_s * middle) for lag_s in self.lags_s)
            low, high = (middle, high) if behind < math.pi else (low, middle)
        return 1.0 / abs(self.response(low)), 2.0 * math.pi / low


def play(law, plant, seconds, noise_k=0.0, most=1.0):
    """Return temperatures, applied powers and the law's belief after a run."""
    rng, belief, power, rows = np.random.default_rng(6), law.start(), 0.0, []
    for t_s in range(seconds):
        reading_c = plant.water_c + noise_k * rng.normal()
        situation = Situation(float(t_s), 1.0, reading_c, SETPOINT_C, power, start(1),
                              NO_PAST, NO_PAST, reading_c)  # fmt: skip
        belief = law.observe(belief, situation)
        belief, asked = law.decide(belief, situation)
        power = min(max(asked, 0.0), most)
        rows.append((plant.water_c, power, *law.remarks(belief)))
        plant.advance(power)
        if "controller.tuning" not in rows[-1]:
            break
    return rows, belief


@pytest.mark.parametrize(
    "plant",
    [
        Plant(),
        Plant(dead_s=30.0, slope=0.01, loss=0.003),
        Plant(dead_s=6.0, lags_s=(8.0,)),
        Plant(dead_s=4.0, lags_s=(13.0, 6.0)),
        Plant(dead_s=15.0, leak_per_s=0.003),
    ],
    ids=("dead time", "slow", "a lag", "two lags", "leaking"),
)
def test_the_relay_finds_the_limit_of_a_plant_that_is_known(plant):
    gain_per_k, period_s = plant.limit()
    _, belief = play(Pid(tuning="relay"), plant, 6000)
    found = tuple(float(word) for word in words(belief))
    assert found == pytest.approx((gain_per_k, period_s), rel=0.08)


def words(belief):
    """Return the ultimate gain and period that are told."""
    _, _, gain, _, _, _, period, _ = belief.tuning.outcome.text.replace(",", "").split()
    return gain, period


def test_its_gains_are_those_of_the_rule_for_that_limit():
    law = Pid(tuning="relay", tuned_form="pid")
    _, belief = play(law, Plant(), 6000)
    limit = Limit(*(float(word) for word in words(belief)))
    expected, gains = tyreus_luyben(limit, derivative=True), law.gains(belief)
    assert gains.gain_per_k == pytest.approx(expected.gain_per_k, rel=0.01)
    assert gains.integral_s == pytest.approx(expected.integral_s, rel=0.01)
    assert gains.derivative_s == pytest.approx(expected.derivative_s, rel=0.01)


def test_noise_of_a_sensor_does_not_disturb_it():
    plant = Plant()
    gain_per_k, period_s = plant.limit()
    _, belief = play(Pid(tuning="relay"), plant, 6000, noise_k=0.01)
    found = tuple(float(word) for word in words(belief))
    assert found == pytest.approx((gain_per_k, period_s), rel=0.1)


@pytest.mark.parametrize("amplitude", [0.1, 0.25, 0.4])
def test_power_swings_no_further_than_its_amplitude_and_temperature_stays_near(amplitude):
    rows, _ = play(Pid(tuning="relay", relay_amplitude=amplitude), Plant(loss=0.008), 3000)
    arrived = next(i for i, row in enumerate(rows) if row[0] > SETPOINT_C)
    tested = np.array([row[:2] for row in rows[arrived:] if "controller.tuning" in row])
    middle = 0.5 * (tested[:, 1].max() + tested[:, 1].min())
    assert np.abs(tested[:, 1] - middle).max() <= 2.0 * amplitude
    assert np.abs(tested[:, 0] - SETPOINT_C).max() < 0.05 * 12.0 * 2.0 * amplitude + 0.2


def test_a_supervisor_that_allows_less_changes_nothing_of_what_is_found():
    plant = Plant()
    gain_per_k, period_s = plant.limit()
    _, belief = play(Pid(tuning="relay"), plant, 6000, most=0.35)
    found = tuple(float(word) for word in words(belief))
    assert found == pytest.approx((gain_per_k, period_s), rel=0.1)


def test_it_goes_on_from_the_power_that_held_the_set_point():
    plant = Plant(loss=0.015)
    rows, belief = play(Pid(tuning="relay"), plant, 6000)
    assert belief.tuning.outcome.holding_power == pytest.approx(0.3, abs=0.03)
    assert rows[-1][1] == pytest.approx(0.3, abs=0.1)


def test_a_swing_that_leaves_the_band_is_given_up():
    law = Pid(tuning="relay")
    _, belief = play(law, Plant(slope=2.0, loss=0.1), 600)
    assert "from the set point" in law.remarks(belief)["controller.tuning_failed"]
    assert law.gains(belief) == GIVEN


def test_a_set_point_that_is_never_reached_is_given_up_after_the_time_limit():
    law = Pid(tuning="relay", tuning_limit_s=1000.0)
    rows, belief = play(law, Plant(loss=0.06), 2000)
    assert len(rows) == pytest.approx(1002, abs=2)
    assert "1000 s" in law.remarks(belief)["controller.tuning_failed"]


# -- the harmonic ----------------------------------------------------------------------------------


@pytest.mark.parametrize("duty", [0.2, 0.5, 0.7])
def test_the_harmonic_of_an_integrator_is_exact_however_lopsided_the_relay(duty):
    slope, period = 0.04, 60
    powers = [1.0 if k < duty * period else 0.2 for k in range(period)]
    mean = sum(powers) / period
    readings_c = 30.0 + slope * np.cumsum(np.array(powers) - mean)
    stretch = Stretch(tuple(Piece(1.0, u, y) for u, y in zip(powers, readings_c, strict=True)))
    omega, response = harmonic_point(stretch, 30.0, 0.1)
    assert omega == pytest.approx(2.0 * math.pi / period)
    assert response == pytest.approx(slope / (1j * omega), rel=1e-9)


def test_a_drift_is_no_part_of_the_swing():
    powers = [1.0] * 30 + [0.0] * 30
    still = 30.0 + 0.04 * np.cumsum(np.array(powers) - 0.5)
    for drift in (0.0, 0.01):
        readings_c = still + drift * np.arange(1, 61)
        stretch = Stretch(tuple(Piece(1.0, u, y) for u, y in zip(powers, readings_c, strict=True)))
        point = harmonic_point(stretch, 30.0, 0.1)
        assert point[1] == pytest.approx(0.04 / (1j * point[0]), rel=1e-9)


def test_power_that_does_not_swing_and_readings_that_are_missing_say_nothing():
    steady = Stretch(tuple(Piece(1.0, 0.3, 20.0 + math.sin(k)) for k in range(50)))
    assert harmonic_point(steady, 20.0, 0.05) is None
    holed = Stretch((*(Piece(1.0, k % 2, 20.0) for k in range(50)), Piece(1.0, 0.0, math.nan)))
    assert harmonic_point(holed, 20.0, 0.0) is None


@pytest.mark.parametrize("omega", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("turn", [0.1, 0.7, 1.5])
def test_the_plant_of_a_response_has_that_response(omega, turn):
    response = 0.04 * cmath.exp(-1j * turn) / (1j * omega * (1.0 + 0.5j * turn))
    found = integrating_plant(omega, response)
    assert found.slope_k_per_s == pytest.approx(0.04)
    assert (found.dead_s, found.lags_s[1]) == pytest.approx((turn / omega, 0.5 * turn / omega))


@pytest.mark.parametrize("lags_s", [(), (9.0,), (20.0, 7.0)])
def test_the_limit_is_where_the_loop_comes_back_upside_down(lags_s):
    limit = limit_of(Process(0.04, 6.0, (math.inf, *lags_s)))
    s = 2j * math.pi / limit.period_s
    loop = limit.gain_per_k * 0.04 * cmath.exp(-6.0 * s) / s
    for lag_s in lags_s:
        loop /= lag_s * s + 1.0
    assert loop == pytest.approx(-1.0)


def test_a_response_ahead_of_an_integrator_is_that_of_no_such_plant():
    assert integrating_plant(0.1, 0.5 + 0.0j) is None


@pytest.mark.parametrize(("growth", "finds"), [(1.0, True), (1.2, False)])
def test_cycles_are_judged_when_they_are_alike(growth, finds):
    test, run, power, t_s, told = RelayTest(False, 0.25, 1.0), None, 0.0, 0, None
    for cycle in range(8):
        length = round(40 * growth**cycle)
        for k in range(length):
            reading_c = SETPOINT_C - 0.3 * math.sin(2.0 * math.pi * k / length)
            situation = Situation(float(t_s), 1.0, reading_c, SETPOINT_C, power, start(1),
                                  NO_PAST, NO_PAST, reading_c)  # fmt: skip
            run = test.observe(run, situation) if run else test.begin(situation)
            told = test.decide(run, situation)
            if not isinstance(told, tuple):
                break
            (run, power), t_s = told, t_s + 1
        if not isinstance(told, tuple):
            break
    assert isinstance(told, Found) is finds


def test_somebody_elses_regulation_is_no_swing():
    test = RelayTest(derivative=False, amplitude=0.25, period_s=1.0)
    run = None
    for k in range(2000):
        reading_c = SETPOINT_C + 0.3 * math.sin(0.1 * k)
        situation = Situation(float(k), 1.0, reading_c, SETPOINT_C, 0.2 - 0.02 * math.cos(0.1 * k),
                              start(1), NO_PAST, NO_PAST, reading_c)  # fmt: skip
        run = test.observe(run, situation) if run else test.begin(situation)
        told = test.decide(run, situation)
        assert isinstance(told, tuple)
        run = told[0]
