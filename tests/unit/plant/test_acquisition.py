"""The converter: pickup that folds, bursts that cancel it, stairs, and ends."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.plant.acquisition import Acquisition, AcquisitionParameters

MILLI = 1e-3
PURE = AcquisitionParameters(bits=16, noise_v=0.0, mains_spread_hz=0.0)


def readings_v(parameters: AcquisitionParameters, samples: int, interval_s=1.0, seed=5):
    acquisition = Acquisition(parameters, np.random.default_rng(seed))
    read = []
    for _ in range(samples):
        read.append(acquisition.convert(3.0) / parameters.full_scale * parameters.reference_v)
        acquisition.advance(interval_s)
    return np.array(read)


def test_single_conversions_fold_the_mains_to_the_difference_from_a_whole_number_of_hertz():
    read = readings_v(replace(PURE, conversions=1, mains_hz=50.01), samples=1000)
    spectrum = np.abs(np.fft.rfft(read - read.mean()))
    assert np.argmax(spectrum) == 10  # 0.01 Hz in 1,000 s
    assert np.ptp(read) == pytest.approx(2 * PURE.pickup_v, rel=0.02)


def test_the_folded_mains_are_smooth_enough_to_look_like_temperature():
    read = readings_v(replace(PURE, conversions=1, mains_spread_hz=0.005), samples=600)
    assert np.std(np.diff(read)) < 0.3 * np.std(read)


def test_a_burst_over_whole_mains_periods_averages_the_pickup_out():
    read = readings_v(PURE, samples=300)
    assert np.ptp(read) < 0.01 * PURE.pickup_v


def test_a_burst_over_a_period_and_a_half_does_not():
    read = readings_v(replace(PURE, burst_s=0.030, mains_spread_hz=0.01), samples=300)
    assert np.ptp(read) > 0.2 * PURE.pickup_v


def test_a_burst_is_worth_more_than_a_factor_of_seven():
    usual = AcquisitionParameters(bits=16)
    single = readings_v(replace(usual, conversions=1), samples=3000)
    burst = readings_v(usual, samples=3000)
    assert np.std(single) > 7.0 * np.std(burst)


def test_white_noise_falls_with_the_root_of_the_conversions():
    noisy = replace(PURE, pickup_v=0.0, noise_v=2.0 * MILLI)
    for conversions in (1, 16, 64):
        read = readings_v(replace(noisy, conversions=conversions), samples=2000)
        assert np.std(read) == pytest.approx(2.0 * MILLI / math.sqrt(conversions), rel=0.08)


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_a_quiet_converter_is_right_within_half_a_step(bits):
    quiet = replace(PURE, bits=bits, pickup_v=0.0, conversions=1)
    acquisition = Acquisition(quiet, np.random.default_rng(0))
    step_v = quiet.reference_v / 2**bits
    for volts in np.linspace(0.0, quiet.reference_v - step_v, 997):
        assert abs(acquisition.convert(volts) * step_v - volts) <= 0.5001 * step_v


def test_ten_bits_without_noise_show_stairs_of_half_a_kelvin():
    quiet = replace(PURE, bits=10, pickup_v=0.0, conversions=1)
    acquisition = Acquisition(quiet, np.random.default_rng(0))
    read = {acquisition.convert(3.0 + t * MILLI) for t in range(50)}  # 5 K
    assert len(read) in (10, 11, 12)


def test_noise_on_the_input_makes_a_burst_finer_than_its_converter():
    usual = AcquisitionParameters(bits=10)
    acquisition = Acquisition(usual, np.random.default_rng(3))
    error_k = []
    for step in range(2000):
        volts = 3.1 + 1e-5 * step
        acquisition.advance(1.0)
        counts = acquisition.convert(volts)
        error_k.append(100.0 * (counts / usual.full_scale * usual.reference_v - volts))
    assert np.std(error_k) < 0.1 * 0.488


def test_open_reads_full_scale_and_short_reads_near_zero():
    usual = AcquisitionParameters()
    acquisition = Acquisition(usual, np.random.default_rng(0))
    assert acquisition.convert(math.inf) == 32 * 1023
    assert acquisition.convert(0.0) < 0.01 * usual.full_scale


@pytest.mark.parametrize("end", [0.0, 1023.0], ids=["bottom", "top"])
def test_at_an_end_of_the_scale_every_conversion_is_limited_and_not_the_burst(end):
    noisy = AcquisitionParameters(pickup_v=0.0, noise_v=0.1)
    volts, rms = end * noisy.reference_v / 1024.0, 0.1 * 1024.0 / noisy.reference_v
    acquisition = Acquisition(noisy, np.random.default_rng(8))
    off = np.array([acquisition.convert(volts) / 32.0 - end for _ in range(400)])
    inwards = off if end == 0.0 else -off
    assert (inwards > 0.0).all()
    # Half of the noise is cut off; the mean of what is left is rms / sqrt(2 pi).
    assert inwards.mean() == pytest.approx(rms / math.sqrt(2.0 * math.pi), rel=0.05)


def test_no_voltage_at_all_cannot_be_converted():
    with pytest.raises(ValueError, match="volts"):
        Acquisition(AcquisitionParameters(), np.random.default_rng(0)).convert(math.nan)


def test_equal_seeds_give_equal_counts():
    usual = AcquisitionParameters()
    assert (readings_v(usual, 200, seed=7) == readings_v(usual, 200, seed=7)).all()
    assert (readings_v(usual, 200, seed=7) != readings_v(usual, 200, seed=8)).any()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("bits", 7),
        ("conversions", 0),
        ("noise_v", -1.0),
        ("mains_hz", 400.0),
        ("burst_s", math.nan),
    ],
)
def test_a_wrong_constant_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        AcquisitionParameters(**{name: value})
