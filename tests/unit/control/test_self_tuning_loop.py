"""The self-tuning law in a closed loop: the paper's plant, and one with a lag nobody told it of."""

from dataclasses import dataclass

import numpy as np
import pytest

from thermoctl.control.minimum_variance import SelfTuningMinimumVariance
from thermoctl.control.on_off import OnOff
from thermoctl.estimation import CorrectedKalman, Guarded, Identifier, RandomWalkKalman
from thermoctl.model.arx import KnownGain
from thermoctl.ports import Situation

SETPOINT_C = 37.5
GAIN_K = 0.0449
HOUR = 3600

DAILY = Guarded(CorrectedKalman(R1=1e-9, R2=0.1), covariance_max=1.0)
PRINTED = CorrectedKalman(R1=0.0, R2=0.01)


@dataclass
class Tank:
    """Water that cools to 0 degC, behind a transport, a heater element and a sensor sheath."""

    noise_k: float = 0.005
    seed: int = 0
    gain_k: float = GAIN_K
    loss: float = 0.009 / SETPOINT_C
    water_c: float = 25.0

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)
        self.element, self.sensor_c, self.transport = 0.0, self.water_c, [0.0] * 3

    def heat(self, power):
        self.transport.append(power)
        self.element += (self.transport.pop(0) - self.element) * (1 - np.exp(-1 / 12))
        self.sensor_c += (self.water_c - self.sensor_c) * (1 - np.exp(-1 / 6))
        self.water_c += self.gain_k * self.element - self.loss * self.water_c

    def read(self):
        return self.sensor_c + self.noise_k * self.rng.normal()


def regulated(tank, reference_time_s, seconds, law=DAILY, upsets=()):
    """Return the true deviation of the water from its set point, and the power, every second."""
    identifier = Identifier(KnownGain(GAIN_K), law, theta0=[1.0])
    controller = SelfTuningMinimumVariance(identifier.structure, reference_time_s)
    belief, power, deviation, powers = identifier.start(), 0.0, [], []
    for t in range(seconds):
        for when, upset in upsets:
            if t == when:
                upset(tank)
        tank.heat(power)
        y = tank.read()
        belief = identifier.update(belief, y, power)
        here = Situation(
            t, 1.0, y, SETPOINT_C, power, belief.estimate, belief.y_past_c, belief.u_past
        )
        power = min(max(controller.decide(None, here)[1], 0.0), 1.0)
        deviation.append(tank.water_c - SETPOINT_C)
        powers.append(power)
    return np.array(deviation), np.array(powers)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_the_law_as_printed_cycles_on_a_lag_it_does_not_know():
    deviation, power = regulated(Tank(), 0.0, HOUR, PRINTED)
    assert 0.3 < np.ptp(deviation[1200:]) < 1.0
    assert np.std(power[1200:]) > 0.3


def test_a_reference_time_of_three_lags_makes_the_deviation_at_least_five_times_smaller():
    plain, _ = regulated(Tank(), 0.0, HOUR, PRINTED)
    calm, _ = regulated(Tank(), 60.0, HOUR, PRINTED)
    assert 5 * rms(calm[1200:]) < rms(plain[1200:])


@pytest.mark.parametrize("noise_k", [0.005, 0.03, 0.1])
def test_with_drift_and_a_generous_noise_it_holds_whatever_the_sensor(noise_k):
    deviation, _ = regulated(Tank(noise_k), 60.0, 2 * HOUR)
    assert deviation.max() < 0.1
    assert rms(deviation[1800:]) < 0.03
    assert np.abs(deviation[1800:]).max() < 0.1


def test_it_comes_back_from_a_doubled_loss_and_from_cold_water():
    def stirred(tank):
        tank.loss *= 2

    def cooled(tank):
        tank.water_c -= 3.3

    upsets = ((HOUR, stirred), (2 * HOUR, cooled))
    deviation, _ = regulated(Tank(0.01), 60.0, 3 * HOUR, upsets=upsets)
    assert np.abs(deviation[HOUR : 2 * HOUR]).max() < 0.6
    assert rms(deviation[2 * HOUR - 900 : 2 * HOUR]) < 0.02
    assert deviation[2 * HOUR :].max() < 0.7
    assert rms(deviation[-900:]) < 0.02


def test_without_drift_an_offset_remains_after_a_change_of_load():
    def stirred(tank):
        tank.loss *= 2

    law = Guarded(CorrectedKalman(R1=0.0, R2=0.1), covariance_max=1.0)
    deviation, _ = regulated(Tank(), 60.0, 2 * HOUR, law, upsets=((HOUR, stirred),))
    assert abs(np.mean(deviation[-900:])) > 0.2


@pytest.mark.parametrize("share", [0.7, 1.4])
def test_a_heater_that_is_not_the_one_it_was_told_of_is_survived(share):
    deviation, _ = regulated(Tank(0.01, gain_k=share * GAIN_K), 60.0, 2 * HOUR)
    assert deviation.max() < 0.6
    assert rms(deviation[HOUR:]) < 0.02


@pytest.mark.slow
def test_it_holds_for_a_day():
    deviation, _ = regulated(Tank(0.03), 60.0, 24 * HOUR)
    assert np.abs(deviation[1800:]).max() < 0.1


def test_changing_over_from_a_thermostat_starts_from_what_the_thermostat_did():
    tank, identifier = Tank(), Identifier(KnownGain(GAIN_K), DAILY, theta0=[1.0])
    thermostat = OnOff()
    calm = SelfTuningMinimumVariance(identifier.structure, 60.0)
    belief, on, power, deviation = identifier.start(), thermostat.start(), 0.0, []
    for t in range(2 * HOUR):
        tank.heat(power)
        y = tank.read()
        belief = identifier.update(belief, y, power)
        here = Situation(
            t, 1.0, y, SETPOINT_C, power, belief.estimate, belief.y_past_c, belief.u_past
        )
        on, switched = thermostat.decide(on, here)
        power = switched if t < HOUR else min(max(calm.decide(None, here)[1], 0.0), 1.0)
        deviation.append(tank.water_c - SETPOINT_C)
    deviation = np.array(deviation)
    thermostat_s = np.abs(deviation[1800:HOUR]).max()
    assert np.abs(deviation[HOUR:]).max() < thermostat_s + 0.05
    assert rms(deviation[-1800:]) < 0.02


def paper_loop(law, runs, sigma=0.1):
    """Return the mean square deviation of O21's loop (27) itself, unbounded input, t >= 20."""
    square = []
    for run in range(runs):
        rng, identifier = np.random.default_rng(run), Identifier(KnownGain(1.0), law)
        controller = SelfTuningMinimumVariance(identifier.structure)
        belief, y, u = identifier.start(), 25.0, np.nan
        for t in range(400):
            belief = identifier.update(belief, y, u)
            here = Situation(
                t, 1.0, y, SETPOINT_C, u, belief.estimate, belief.y_past_c, belief.u_past
            )
            u = controller.decide(None, here)[1]
            pole = 0.95 + 0.03 * np.sin(2 * np.pi * t / 400)
            y = pole * y + u + sigma * rng.normal()
            if t >= 20:
                square.append((y - SETPOINT_C) ** 2)
    return np.mean(square)


def test_in_the_paper_s_own_loop_the_correction_keeps_the_deviation_near_the_noise():
    corrected = paper_loop(CorrectedKalman(R2=0.01), 10)
    normal = paper_loop(RandomWalkKalman(R2=0.01), 10)
    drifting = paper_loop(RandomWalkKalman(R1=1e-6, R2=0.01), 10)
    assert 0.01 < corrected < 0.02
    assert normal > 10 * corrected
    assert drifting == pytest.approx(corrected, rel=0.3)
