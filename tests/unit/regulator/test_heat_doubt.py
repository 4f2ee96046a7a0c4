"""What may be missing of the heat, where half of full power only holds the plant."""

import math

import pytest

from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.doubt import HeatDoubt
from thermoctl.regulator.heater.response import Gain, Seen

GAIN = Gain(0.5, 0.01, 1)
SPAN_S, SD_K, HELD = 4.0, 0.03, 0.55


class Stood:
    """A plant that 55 % of full power has held at 50 degC for a few minutes."""

    def __init__(self):
        self.doubt, self.now = HeatDoubt(), Seen(0.0, 50.0, (0.0,) * 6)
        assert self.doubted_after(HELD, 0.0, 200.0, follow=True) == math.inf

    def doubted_after(self, power, rate, seconds, *, follow=False, **keys):
        """Return after how many s of `power` a reading that moves by `rate` in K/s is a doubt."""
        for block in range(round(seconds / SPAN_S)):
            before, heat_s = self.now, self.now.heat_s[0] + power * SPAN_S
            reading_c = before.reading_c + rate * SPAN_S
            self.now = Seen(before.t_s + SPAN_S, reading_c, (heat_s,) * 6)
            met = Block(SPAN_S, power, reading_c, SD_K)
            self.doubt.compare(GAIN, met, before, self.now, jumped=False, follow=follow, **keys)
            if self.doubt.cold(GAIN, SD_K):
                return (block + 1) * SPAN_S
        return math.inf


def test_a_reading_that_stands_still_under_full_power_is_soon_a_doubt():
    assert Stood().doubted_after(1.0, 0.0, 300.0) < 90.0


def test_of_a_heater_not_seen_to_obey_half_of_the_heat_may_be_missing():
    assert Stood().doubted_after(1.0, 0.0, 300.0, proven=False) == math.inf


@pytest.mark.parametrize("rate", [0.5 * 0.225, 0.4])
def test_a_plant_that_rises_by_half_of_what_its_loss_leaves_is_no_doubt(rate):
    assert Stood().doubted_after(1.0, rate, 3300.0) == math.inf


def test_a_loss_that_grows_by_a_tenth_of_full_power_at_once_is_no_doubt():
    assert Stood().doubted_after(HELD + 0.1, 0.0, 300.0) == math.inf


def test_what_was_answered_well_is_not_asked_again():
    stood = Stood()
    assert stood.doubted_after(1.0, 0.0, 300.0) < 90.0
    stood.doubt.trust()
    stood.doubt.clear()
    assert stood.doubted_after(1.0, 0.0, 300.0) == math.inf


def test_after_a_good_answer_it_counts_as_before_half_an_hour_later():
    stood = Stood()
    stood.doubt.trust()
    assert stood.doubted_after(HELD, 0.0, 1800.0, follow=True) == math.inf
    assert stood.doubted_after(1.0, 0.0, 300.0) < 90.0


def test_how_a_plant_cooled_is_remembered_when_a_gain_is_learnt_from_an_output_that_sticks():
    doubt, now = HeatDoubt(), Seen(0.0, 25.0, (0.0,) * 6)
    hot_after_s = math.inf
    for second in range(0, 180, 4):
        power = 1.0 if second < 100 else 0.0
        heat_s, rise_k = (
            now.heat_s[0] + power * SPAN_S,
            SPAN_S * (0.5 - 0.01 * now.reading_c + 0.25),
        )
        before, now = now, Seen(now.t_s + SPAN_S, now.reading_c + rise_k, (heat_s,) * 6)
        known = GAIN._replace(cools_per_s=0.01) if second < 100 else GAIN._replace(mean=0.36)
        block = Block(SPAN_S, power, now.reading_c, SD_K)
        doubt.compare(known, block, before, now, jumped=False, follow=power > 0.0)
        if doubt.hot(known, SD_K):
            hot_after_s = min(hot_after_s, second - 100.0)
    assert hot_after_s < 60.0


class Fallen:
    """Held at 180 degC by 45 % of power, risen from 22 degC; its reading falls into that air.

    Until it was asked, or for 400 s, `asked_after_s` of full power are given.
    """

    def __init__(self, start_c):
        self.doubt, self.now = HeatDoubt(), Seen(0.0, start_c, (0.0,) * 6)
        self.asked_after_s = math.inf
        rising = round((180.0 - start_c) / (0.5 * SPAN_S))
        for power, rate, blocks in ((1.0, 0.5, rising), (0.45, 0.0, 150)):
            self.see(power, rate, blocks, follow=rate == 0.0)
        self.see(0.0, -7.9, 5)
        for block in range(100):
            self.see(1.0, 0.0, 1)
            if self.doubt.silent(GAIN, 6e-5, self.now, SD_K, again=False) is not None:
                self.asked_after_s = (block + 1) * SPAN_S
                return

    def see(self, power, rate, blocks, *, follow=False):
        for _ in range(blocks):
            before, heat_s = self.now, self.now.heat_s[0] + power * SPAN_S
            reading_c = before.reading_c + rate * SPAN_S
            self.now = Seen(before.t_s + SPAN_S, reading_c, (heat_s,) * 6)
            met = Block(SPAN_S, power, reading_c, SD_K)
            self.doubt.compare(GAIN, met, before, self.now, jumped=False, follow=follow)


@pytest.mark.parametrize("start_c", [22.0, 180.0])
def test_what_a_plant_loses_where_it_is_hot_explains_no_silence_where_it_was_coldest(start_c):
    assert Fallen(start_c).asked_after_s <= 32.0
