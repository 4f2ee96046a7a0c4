"""What is told of a plant does not depend on who steers it, on the shipped aquarium."""

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, profile
from thermoctl.control.gpc import SelfTuningGpc
from thermoctl.insight.witness import Witness
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import ChooseController, ChooseShadow, SetPoint

pytestmark = pytest.mark.slow

LEARNT_S = 3000


def told(later, until_s):
    """Return what is believed of the plant at every second; `later` says what is asked when."""
    document = load(profile("aquarium")).model_dump()
    document["loops"]["tank"] |= {"controller": {"kind": "adaptive"}, "shadow": {"kind": "pid"}}
    cycles, clock, witness, plants, applied = [], SimulatedClock(), Witness(1.0), [], 0.0
    loop = loop_for(bench_settings(load(document), 51), clock, cycles.append, beside=False)
    for second in range(until_s):
        clock.sleep_until(second)
        for request in later.get(second, ()):
            loop.ask(request)
        loop.cycle(second)
        plants.append(witness.after(cycles[-1].step, applied))
        applied = cycles[-1].accepted_power
    loop.shut_down()
    return plants


def test_a_bank_that_goes_into_the_shadow_still_tells_of_its_plant():
    plants = told({LEARNT_S: [ChooseController("pid")]}, LEARNT_S + 600)
    before, after = plants[LEARNT_S - 1], plants[LEARNT_S + 599]
    assert after.gain_k_per_s == pytest.approx(before.gain_k_per_s, abs=before.gain_sd_k_per_s)
    assert after.lag_s == pytest.approx(before.lag_s, rel=0.05)
    assert after.lag_high_s - after.lag_low_s < 1.2 * (before.lag_high_s - before.lag_low_s)


def test_what_a_bank_knew_is_not_forgotten_when_nobody_has_words_any_more():
    later = {
        LEARNT_S: [ChooseController("pid")],
        LEARNT_S + 10: [ChooseShadow(SelfTuningGpc())],
        LEARNT_S + 600: [SetPoint(40.0)],
    }
    plants = told(later, LEARNT_S + 1200)
    known = plants[LEARNT_S - 1]
    for second in range(LEARNT_S + 60, LEARNT_S + 1200):
        plant = plants[second]
        off = abs(plant.gain_k_per_s - known.gain_k_per_s)
        assert off < 3.0 * plant.gain_sd_k_per_s, second
        assert plant.lag_low_s <= known.lag_s <= plant.lag_high_s, second
    assert plants[LEARNT_S + 1199].lag_s == pytest.approx(known.lag_s, rel=0.05)
