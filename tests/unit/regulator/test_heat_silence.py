"""Heat of a strong heater of which a reading shows nothing."""

import pytest

from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.doubt import HeatDoubt
from thermoctl.regulator.heater.response import Gain, Seen
from thermoctl.regulator.heater.silence import Silence

STRONG = Gain(0.5, 0.01, 2)
SPAN_S, SD_K = 4.0, 0.02


class Vessel:
    """A reading and the heat that has arrived, all of it after a lag of 20 s."""

    def __init__(self, gain=STRONG):
        self.gain, self.silence, self.powers = gain, Silence(), [0.0] * 5
        self.now = Seen(0.0, 60.0, (0.0,) * 6)

    def asked_after(self, power, rates, *, loss=0.01, again=False, answered=False):
        """Return after how many s of `power` it is asked, or None; `rates` in K/s, one a block."""
        for block, rate in enumerate(rates):
            self.powers.append(power)
            before, heat_s = self.now, self.now.heat_s[0] + self.powers[-6] * SPAN_S
            reading_c = before.reading_c + rate * SPAN_S
            self.now = Seen(before.t_s + SPAN_S, reading_c, (heat_s,) * 6)
            met = Block(SPAN_S, power, reading_c, SD_K)
            self.silence.add(self.gain, met, before, self.now, loss * SPAN_S)
            cut = self.silence.question(
                self.gain, 6e-5, self.now, SD_K, again=again, answered=answered
            )
            if cut is not None:
                return (block + 1) * SPAN_S, cut
        return None


def rested(gain=STRONG):
    vessel = Vessel(gain)
    assert vessel.asked_after(0.05, [0.0] * 10) is None
    return vessel


def test_a_reading_that_stood_and_shows_nothing_of_full_power_is_asked_after_a_lag_and_a_half():
    after_s, cut = rested().asked_after(1.0, [0.0] * 20)
    assert 24.0 <= after_s <= 32.0
    assert not cut.wild
    assert not cut.quiet


def test_a_weak_heater_is_left_to_the_doubt():
    assert rested(STRONG._replace(mean=0.09)).asked_after(1.0, [0.0] * 60) is None


@pytest.mark.parametrize("share", [0.2, 0.3, 0.5])
def test_a_part_of_the_rise_is_enough(share):
    assert rested().asked_after(1.0, [0.0] * 5 + [share * 0.5] * 40) is None


def test_power_that_only_makes_up_for_a_load_is_expected_to_do_nothing():
    assert rested().asked_after(0.5, [0.0] * 60) is None


def test_a_loss_of_half_of_full_power_may_have_doubled():
    assert rested().asked_after(1.0, [0.0] * 60, loss=0.25) is None


def test_a_plant_that_rose_and_then_stands_is_no_more_in_doubt_than_before():
    vessel = rested()
    assert vessel.asked_after(1.0, [0.0] * 5 + [0.5] * 10) is None
    assert vessel.asked_after(1.0, [0.0] * 60) is None


def test_what_has_answered_well_may_stand():
    assert rested().asked_after(1.0, [0.0] * 60, answered=True) is None


def test_a_fall_that_no_heater_makes_and_that_comes_to_rest_is_asked_about_as_wild():
    vessel = rested()
    assert vessel.asked_after(1.0, [0.5] * 10) is None
    after_s, cut = vessel.asked_after(1.0, [-2.0, -1.0, -0.6, -0.3, -0.15] + [0.0] * 20)
    assert after_s <= 40.0
    assert cut.wild
    assert cut.began_s is None


def test_a_jug_of_cold_water_is_no_doubt():
    vessel = rested()
    assert vessel.asked_after(1.0, [-1.5, -1.0, -0.6, -0.2, 0.0, 0.2] + [0.4] * 20) is None


def test_a_fall_that_goes_on_and_on_is_asked_about_after_a_lag_and_a_half():
    after_s, cut = rested().asked_after(0.8, [-0.8] * 20)
    assert 30.0 <= after_s <= 36.0
    assert cut.wild


def test_after_a_bad_answer_a_portion_of_heat_has_to_do():
    vessel = rested()
    vessel.silence.clear()
    after_s, cut = vessel.asked_after(1.0, [0.0] * 20, again=True)
    assert after_s == 8.0  # 3 K at half a kelvin a second, in blocks of 4 s
    assert cut.quiet
    assert cut.portion


def test_no_portion_is_enough_while_a_reading_still_comes_to_rest():
    vessel = rested()
    vessel.silence.clear()
    asked = vessel.asked_after(1.0, [-0.1] * 4, again=True)
    assert asked is None


def asked_after_falls(powers):
    """Return after how many blocks of a steep fall, in turn under these powers, it is asked."""
    doubt, now, sd_k = HeatDoubt(), Seen(0.0, 60.0, (0.0,) * 6), 0.5
    doubt.begin(now._replace(t_s=-SPAN_S), now)
    for n in range(60):
        power = powers[n % len(powers)]
        before, heat_s = now, now.heat_s[0] + power * SPAN_S
        now = Seen(before.t_s + SPAN_S, before.reading_c - 0.8 * SPAN_S, (heat_s,) * 6)
        block = Block(SPAN_S, power, now.reading_c, sd_k)
        doubt.compare(STRONG, block, before, now, jumped=False, follow=False)
        if doubt.silent(STRONG, 6e-5, now, sd_k, again=False) is not None:
            return n + 1
    return None


def test_of_blocks_that_are_taken_together_for_their_noise_all_of_the_power_counts():
    assert STRONG.mean * SPAN_S < 6.0 * 0.5 < 2.0 * STRONG.mean * SPAN_S  # two at a time
    assert asked_after_falls([1.0, 0.2]) == asked_after_falls([0.2, 1.0]) == 8
