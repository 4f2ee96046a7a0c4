"""The constants of the default law: each is a setting, bounded, and does something."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
import pytest

from thermoctl.app import plugins
from thermoctl.control.adaptive import Adaptive
from thermoctl.control.adaptive.coasting import power_for
from thermoctl.control.adaptive.constants import Hearing, Lags, Pace, Plants

TABLES = {"lags": Lags(), "plants": Plants(), "hearing": Hearing(), "pace": Pace()}
CONSTANTS = [(table, each.name) for table in TABLES for each in fields(TABLES[table])]


class Vessel:
    """Water behind a heater of 20 s and a sensor of 8 s: warmed, drained, chilled, uncovered."""

    def __init__(self, gain, period_s, hum_k=0.0):
        self.hum_k, self.time_s = hum_k, 0.0
        self.rng, self.gain, self.period_s = np.random.default_rng(1), gain, period_s
        self.water_c = self.sensor_c = 30.0
        self.heat, self.loss_per_s = 0.0, 4e-4

    def after(self, power):
        for _ in range(int(self.period_s)):
            self.heat += (1 - math.exp(-1 / 20)) * (power - self.heat)
            self.water_c += self.gain * self.heat - self.loss_per_s * (self.water_c - 15.0)
            self.water_c += 0.0003 * self.rng.standard_normal()
            self.sensor_c += (1 - math.exp(-1 / 8)) * (self.water_c - self.sensor_c)
        self.time_s += self.period_s
        hum_k = self.hum_k * math.sin(2.0 * math.pi * self.time_s / 37.0)
        return self.sensor_c + 0.003 * self.rng.standard_normal() + hum_k

    def suffer(self, sample):
        if sample in (1200, 1400):
            self.water_c -= 3.0
        if sample in (600, 700, 800, 900):
            self.loss_per_s *= 1.5


@lru_cache
def powers(law, gain=0.036, start=37.5, heated=0, hum_k=0.0):
    """Return what `law` asks for while things happen to a vessel, set point and heater."""
    bank, vessel = law.bank, Vessel(gain, law.period_s, hum_k)
    for _ in range(heated):
        vessel.after(1.0)
    belief, power, asked = bank.start(), float(heated > 0), []
    for sample in range(1600):
        vessel.suffer(sample)
        y = math.nan if sample == 450 else vessel.after(power)
        belief = bank.observe(belief, y, power)
        set_c = start if sample < 150 else 40.0
        power = power_for(
            belief.outlook, set_c, law.calmness, law.period_s, bank.bounds, power, 0.0, law.pace
        )
        asked.append(power)
    return asked


STORIES = [
    (Adaptive(), 0.036, 37.5, 0),
    (Adaptive(), 0.036, 30.2, 0),
    (Adaptive(), 0.036, 32.0, 30),
    (Adaptive(), 0.4, 37.5, 0),
    (Adaptive(calmness=0.1), 0.0004, 37.5, 0),
    (Adaptive(calmness=0.1, period_s=10.0), 0.036, 37.5, 0),
    (Adaptive(calmness=0.1), 3.0, 37.5, 0),
    (Adaptive(), 0.036, 37.5, 0, 0.2),
]
"""A rig from cold, nearly warm, and in a warm-up; a small, a vast, a coarsely sampled
and a fierce one; and one with a sensor that hums."""


@pytest.mark.slow
@pytest.mark.parametrize(("table", "name"), CONSTANTS)
def test_every_constant_makes_a_difference_to_some_plant(table, name):
    value = getattr(TABLES[table], name)
    others = [2 * value, value // 2] if name == "count" else [1.5 * value, 0.1 * value]
    assert any(
        powers(replace(law, **{table: replace(TABLES[table], **{name: other})}), *story)
        != powers(law, *story)
        for other in others
        if name != "fastest_periods" or other >= 1.0
        for law, *story in STORIES
    )


@pytest.mark.parametrize(("table", "name"), CONSTANTS)
def test_a_constant_outside_its_range_is_refused_by_its_name(table, name):
    (each,) = (each for each in fields(TABLES[table]) if each.name == name)
    for bad in (
        each.metadata["minimum"] - 1.0,
        1.1 * each.metadata["maximum"],
        math.nan,
        "1",
        None,
    ):
        with pytest.raises(ValueError, match=rf"^{name} must lie in \["):
            replace(TABLES[table], **{name: bad})


@pytest.mark.parametrize(
    ("table", "settings", "text"),
    [
        ("lags", {"shortest_s": 3.0, "longest_s": 3.0}, "longest_s must be above shortest_s"),
        ("lags", {"count": 24.0}, "count must be a whole number, got 24.0"),
        ("hearing", {"suspected_sds": 14.0}, "drifted_sds must be above suspected_sds, 14"),
    ],
)
def test_constants_that_do_not_fit_together_are_refused(table, settings, text):
    with pytest.raises(ValueError, match=text):
        replace(TABLES[table], **settings)


def test_constants_stand_in_tables_within_that_of_the_controller():
    law = plugins.build(Adaptive, {"lags": {"longest_s": 600.0}, "pace": {"caution": 2}})
    assert law.lags == Lags(longest_s=600.0)
    assert law.pace == Pace(caution=2.0)
    assert law.bank.hypotheses.lag_s.max() == pytest.approx(600.0)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"lags": {"longest": 600.0}}, "lags.longest: unknown key; did you mean 'longest_s'"),
        ({"lags": {"longest_s": 1e9}}, r"lags.longest_s: expected a number in \[0.1, 86400\]"),
        ({"lags": 600.0}, "lags: expected a table, got 600.0"),
        ({"pace": {"caution": "much"}}, "pace.caution: expected a valid number, got 'much'"),
    ],
)
def test_a_bad_constant_is_told_with_its_table(options, text):
    with pytest.raises(plugins.BadOption, match=text):
        plugins.build(Adaptive, options)


def test_what_a_bank_of_other_lags_has_learnt_is_refused():
    told = learnt(Adaptive())
    Adaptive(pace=Pace(caution=2.0)).start_from(told, 0.0)  # which weighs no lag otherwise
    for lags in (Lags(longest_s=600.0), Lags(count=12), Lags(pipe_beyond_s=30.0)):
        with pytest.raises(ValueError, match="expected hypotheses"):
            Adaptive(lags=lags).start_from(told, 0.0)


def learnt(law):
    """Return what `law` keeps of ten minutes of warming up and holding a vessel."""
    vessel, belief, power = Vessel(0.036, law.period_s), law.bank.start(), 0.0
    for _ in range(600):
        belief = law.bank.observe(belief, vessel.after(power), power)
        power = power_for(belief.outlook, 37.5, law.calmness, 1.0, law.bank.bounds, power)
    return law.remember(law.start()._replace(bank=belief))
