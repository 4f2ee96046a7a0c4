"""Sensor curves and the judgement of wiring, against published figures and round trips."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.model.sensor import (
    LM35,
    LM335,
    TMP36,
    Beta,
    Calibration,
    LinearConversion,
    Platinum,
    PullUp,
    Sensor,
    Steinhart,
)
from thermoctl.signals import Measurement, Quality, RawSample

quickly = settings(max_examples=100, deadline=None, derandomize=True)
CURVES = {
    "PT100": Platinum(100.0),
    "PT1000": Platinum(1000.0),
    "Steinhart": Steinhart(1.129148e-3, 2.34125e-4, 8.76741e-8),
    "Beta": Beta(10_000.0, 3950.0),
}
CONVERSIONS = {
    "LM335": LM335,
    "LM35": LM35,
    "TMP36": TMP36,
    "linear": LinearConversion(-12.5, 80.0),
    "PT1000 divider": PullUp(Platinum(1000.0), 2_200.0, 5.0),
    "NTC divider": PullUp(Beta(), 10_000.0, 3.3),
}


def raw(fraction: float) -> RawSample:
    return RawSample(t_s=3.0, counts=fraction * 32 * 1024, full_scale=32 * 1024.0)


@pytest.mark.parametrize("name", CONVERSIONS)
@quickly
@given(temperature_c=st.floats(-40.0, 125.0))
def test_a_conversion_reads_back_the_temperature_it_was_given(name, temperature_c):
    conversion = CONVERSIONS[name]
    read = conversion.temperature_c(conversion.volts(temperature_c))
    assert read == pytest.approx(temperature_c, abs=1e-8)


@pytest.mark.parametrize("name", CURVES)
@quickly
@given(temperature_c=st.floats(-60.0, 150.0))
def test_a_resistance_curve_reads_back_the_temperature_it_was_given(name, temperature_c):
    curve = CURVES[name]
    assert curve.temperature_c(curve.ohm(temperature_c)) == pytest.approx(temperature_c, abs=1e-8)


@quickly
@given(st.floats(-200.0, 850.0))
def test_platinum_reads_back_over_its_whole_range(temperature_c):
    curve = Platinum()
    assert curve.temperature_c(curve.ohm(temperature_c)) == pytest.approx(temperature_c, abs=1e-9)


@pytest.mark.parametrize(
    ("temperature_c", "ohm"),
    [(-200.0, 18.5201), (-50.0, 80.3063), (0.0, 100.0), (37.5, 114.5749), (100.0, 138.5055)],
)
def test_platinum_meets_the_table_of_iec_60751(temperature_c, ohm):
    assert Platinum(100.0).ohm(temperature_c) == pytest.approx(ohm, abs=5e-5)


def test_platinum_is_not_defined_outside_its_range():
    curve = Platinum()
    outside = (curve.ohm(-200.1), curve.ohm(850.1), curve.temperature_c(18.0))
    assert all(math.isnan(value) for value in outside)
    assert math.isnan(curve.temperature_c(400.0))


def test_an_ntc_by_beta_has_its_nominal_resistance_at_25_degrees():
    assert Beta(10_000.0, 3950.0).ohm(25.0) == pytest.approx(10_000.0)


def test_steinhart_and_hart_give_ten_kilohm_at_25_degrees_for_the_common_thermistor():
    curve = Steinhart(1.129148e-3, 2.34125e-4, 8.76741e-8)
    assert curve.temperature_c(10_000.0) == pytest.approx(25.0, abs=0.01)


@pytest.mark.parametrize("temperature_c", [-273.15, -300.0, math.nan])
def test_no_thermistor_has_a_resistance_at_or_below_absolute_zero(temperature_c):
    assert math.isnan(CURVES["Steinhart"].ohm(temperature_c))
    assert math.isnan(CURVES["Beta"].ohm(temperature_c))


def test_the_lm335_at_the_set_point_of_the_rig_reads_636_counts_of_1024():
    sensor = Sensor(LM335, reference_v=5.0)
    assert LM335.volts(37.5) == pytest.approx(3.1065)
    assert 1024 * sensor.fraction(37.5) == pytest.approx(636.2, abs=0.05)


@pytest.mark.parametrize(("conversion", "volts"), [(LM35, 0.25), (TMP36, 0.75), (LM335, 2.9815)])
def test_a_semiconductor_sensor_gives_its_data_sheet_voltage_at_25_degrees(conversion, volts):
    assert conversion.volts(25.0) == pytest.approx(volts)


@quickly
@given(st.floats(0.95, 1.05), st.floats(-40.0, 100.0), st.floats(-40.0, 100.0))
def test_one_point_calibration_of_an_lm335_corrects_every_temperature(gain, point_c, any_c):
    calibration = Calibration.by_gain(LM335, LM335.volts(point_c) * gain, point_c)
    sensor = Sensor(LM335, reference_v=5.0, calibration=calibration)
    wrong_v = LM335.volts(any_c) * gain
    assert sensor.temperature_c(wrong_v / 5.0) == pytest.approx(any_c, abs=1e-9)


def test_the_largest_corrections_are_still_taken():
    for gain, offset_k in ((0.8, -20.0), (1.25, 20.0)):
        assert Calibration(gain, offset_k).gain == gain


def test_calibration_by_offset_shifts_the_reading():
    calibration = Calibration.by_offset(TMP36, TMP36.volts(24.0), 25.0)
    assert calibration == Calibration(offset_k=1.0)


@quickly
@given(st.floats(-40.0, 100.0), st.floats(0.9, 1.1), st.floats(-5.0, 5.0))
def test_a_calibrated_sensor_reads_back_the_temperature_it_was_given(t_c, gain, offset_k):
    sensor = Sensor(LM335, 5.0, calibration=Calibration(gain, offset_k))
    assert sensor.temperature_c(sensor.fraction(t_c)) == pytest.approx(t_c, abs=1e-9)


def test_a_good_sample_carries_its_own_time_and_temperature():
    sensor = Sensor(LM335, 5.0)
    measurement = sensor.measure(raw(sensor.fraction(37.5)), t_s=99.0)
    assert (measurement.t_s, measurement.quality) == (3.0, Quality.GOOD)
    assert measurement.temperature_c == pytest.approx(37.5)


@pytest.mark.parametrize(
    ("fraction", "quality"),
    [(1023 / 1024, Quality.OPEN), (0.981, Quality.OPEN), (0.0, Quality.SHORT), (-1, Quality.SHORT)],
)
def test_open_and_short_are_judged_on_counts_and_carry_no_temperature(fraction, quality):
    measurement = Sensor(LM335, 5.0).measure(raw(fraction))
    assert measurement.quality is quality
    assert math.isnan(measurement.temperature_c)


def test_no_sample_is_missing_at_the_time_that_was_asked_for():
    measurement = Sensor(LM335, 5.0).measure(None, t_s=7.0)
    assert (measurement.t_s, measurement.quality) == (7.0, Quality.MISSING)
    assert math.isnan(measurement.temperature_c)


@pytest.mark.parametrize(
    ("fraction", "quality"), [(0.97, Quality.OPEN), (0.03, Quality.SHORT), (0.5, Quality.GOOD)]
)
def test_a_resistance_off_its_curve_is_a_fault_on_the_nearer_side(fraction, quality):
    sensor = Sensor(PullUp(Platinum(1000.0), 2200.0, 5.0), reference_v=5.0)
    assert sensor.measure(raw(fraction)).quality is quality


ANYTHING = st.floats(allow_nan=True, allow_infinity=True)


@pytest.mark.parametrize("r25_ohm", [5e-324, 10_000.0, 1e308])
@pytest.mark.parametrize("ohm", [5e-324, 1e308])
def test_a_thermistor_whose_resistance_is_beyond_every_ratio_is_off_its_curve(ohm, r25_ohm):
    assert not Beta(r25_ohm).temperature_c(ohm) > 1e6


@pytest.mark.parametrize("name", CONVERSIONS)
@quickly
@given(counts=ANYTHING, full_scale=ANYTHING)
def test_no_sample_whatsoever_makes_a_sensor_raise_or_call_nonsense_good(name, counts, full_scale):
    measurement = Sensor(CONVERSIONS[name], 5.0).measure(RawSample(0.0, counts, full_scale))
    assert isinstance(measurement, Measurement)
    good = measurement.quality is Quality.GOOD
    assert math.isfinite(measurement.temperature_c) == good


@pytest.mark.parametrize(
    ("build", "named"),
    [
        (lambda: Sensor(LM335, 0.0), "reference_v"),
        (lambda: Sensor(LM335, math.nan), "reference_v"),
        (lambda: Sensor(LM335, 5.0, open_above=0.1, short_below=0.2), "short_below"),
        (lambda: LinearConversion(0.0, 1.0), "kelvin_per_v"),
        (lambda: LinearConversion(1.0, math.inf), "zero_v_c"),
        (lambda: Platinum(-1.0), "r0_ohm"),
        (lambda: Steinhart(1e-3, 0.0, 1e-7), "b must"),
        (lambda: Steinhart(math.nan, 1e-4, 1e-7), "a must"),
        (lambda: Beta(beta_k=-1.0), "beta_k"),
        (lambda: PullUp(Platinum(), 0.0, 5.0), "pull_up_ohm"),
        (lambda: Calibration(gain=0.79), "gain"),
        (lambda: Calibration(gain=1.26), "gain"),
        (lambda: Calibration(offset_k=-20.1), "offset_k"),
        (lambda: Calibration(offset_k=math.nan), "offset_k"),
        (lambda: Calibration.by_gain(LM335, 0.0, 25.0), "volts"),
    ],
)
def test_a_wrong_constant_is_refused_by_name(build, named):
    with pytest.raises(ValueError, match=named):
        build()
