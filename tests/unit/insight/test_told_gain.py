"""Which gain is told, and with which error: laws of what a bank cannot know."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.insight import Insights
from thermoctl.insight.told_gain import APART_K, GROWTH, SEEN_NOISES, ToldGain, is_seen
from thermoctl.signals import (
    Command,
    Estimate,
    Measurement,
    Mode,
    PlantBelief,
    Quality,
    State,
    Step,
)

PLANT = PlantBelief(
    *(4.5e-4, 1.5e-5, 5e-5, 2e-6, 0.11, 0.01, 46.0, 36.0, 57.0, 25.5, 0.008),
    learning=False,
    jumped=False,
)
"""An aquarium: full power moves it by 20 mK within a lag, its readings are noisy by 8 mK."""
NOISE = replace(PLANT, gain_k_per_s=9.5e-5, gain_sd_k_per_s=1.1e-5, lag_s=12.8)
"""What a bank took it for after four hours at rest."""
QUICKER = replace(PLANT, gain_k_per_s=4e-3, gain_sd_k_per_s=1e-4, lag_s=10.0)
PERIOD_S, HOUR_S = 10.0, 3600
AT_REST_C, SWUNG_K = 25.5, 0.02


class Watched:
    """A loop whose plant is believed to be whatever a test says."""

    def __init__(self):
        self.watch, self.t_s = Insights(PERIOD_S, 200.0), 0.0
        self.rng = np.random.default_rng(1)

    def live(self, seconds, plant, away_k=0.0):
        """Go on for some time, `away_k` from the set point."""
        for _ in range(round(seconds / PERIOD_S)):
            self.t_s += PERIOD_S
            reading_c = AT_REST_C + away_k + plant.noise_sd_k * self.rng.standard_normal()
            step = Step(
                t_s=self.t_s,
                measurement=Measurement(self.t_s, reading_c, Quality.GOOD),
                mode=Mode.AUTO,
                state=State.RUN,
                setpoint_c=AT_REST_C,
                command=Command(0.11, self.t_s + 3.0 * PERIOD_S, "control"),
                controller="adaptive",
                estimate=Estimate(np.zeros(1), np.eye(1)),
                tell=lambda: plant,
            )
            self.watch.after(step, 0.11)
        return {row.name: row for row in self.watch.now.rows}


def test_a_lag_in_which_nothing_moves_is_not_seen():
    assert is_seen(PLANT)
    assert not is_seen(NOISE)
    least_k = SEEN_NOISES * PLANT.noise_sd_k
    assert not is_seen(replace(PLANT, gain_k_per_s=0.99 * least_k / PLANT.lag_s))
    assert is_seen(replace(PLANT, gain_k_per_s=-1.01 * least_k / PLANT.lag_s))


def test_a_gain_that_goes_with_a_lag_nobody_sees_is_not_told():
    assert math.isnan(ToldGain().after(NOISE, 25.5).mean)


def test_a_loss_that_hardly_grows_within_a_lag_leaves_the_error_as_it_is():
    told = ToldGain().after(PLANT, 25.5)
    assert told.mean == PLANT.gain_k_per_s
    assert told.sd == pytest.approx(PLANT.gain_sd_k_per_s, rel=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_loss_that_grows_within_a_lag_widens_the_error(sign):
    block = replace(
        PLANT,
        gain_k_per_s=sign * 0.49,
        gain_sd_k_per_s=0.01,
        loss_k_per_s=sign * 0.13,
        loss_sd_k_per_s=0.005,
        lag_s=14.0,
    )
    told = ToldGain()
    first = told.after(block, 40.0)
    later = told.after(block, 40.0 - sign * 2.0 * APART_K)
    for each, apart_k in ((first, APART_K), (later, 2.0 * APART_K)):
        share = GROWTH * 0.14 * 14.0 / apart_k
        assert each.sd == pytest.approx(math.hypot(0.01, 0.49 * share))
    assert told.after(block, math.nan) == later


@pytest.mark.parametrize(
    "strayed",
    [NOISE, replace(NOISE, noise_sd_k=1e-4)],
    ids=["a lag that nobody sees", "a lag that begins to stray at rest"],
)
def test_what_a_bank_comes_to_believe_at_rest_replaces_no_gain(strayed):
    loop = Watched()
    known = loop.live(HOUR_S, PLANT)["gain"]
    assert known.value == pytest.approx(60.0 * PLANT.gain_k_per_s)
    loop.live(600, strayed, away_k=-1.0) if strayed is NOISE else None
    told = loop.live(3 * HOUR_S, strayed)
    assert told["gain"] == known
    assert told["volume"].value == pytest.approx(200.0 / PLANT.gain_k_per_s / 4181.0, rel=0.01)


def test_a_loss_is_told_of_the_gain_that_is_told():
    loop = Watched()
    loop.live(HOUR_S, PLANT)
    resting = replace(NOISE, loss_k_per_s=0.11 * NOISE.gain_k_per_s)
    told = loop.live(3 * HOUR_S, resting)["loss"]
    assert told.value == pytest.approx(60.0 * 0.11 * PLANT.gain_k_per_s)


def test_another_plant_that_a_move_showed_is_learnt():
    loop = Watched()
    loop.live(HOUR_S, PLANT)
    loop.live(600, QUICKER, away_k=-1.0)
    told = loop.live(2 * HOUR_S, QUICKER)
    assert told["gain"].value == pytest.approx(60.0 * QUICKER.gain_k_per_s)


def test_a_plant_that_was_hidden_is_known_from_the_move_that_shows_it():
    loop = Watched()
    hidden = loop.live(HOUR_S, NOISE)
    for name in ("gain", "loss", "lag", "volume"):
        assert hidden[name].text == "– the noise hides the lag", name
    assert hidden["holding_power"].value == pytest.approx(11.0)
    loop.live(600, PLANT, away_k=-1.0)
    told = loop.live(2 * HOUR_S, PLANT)
    assert told["gain"].value == pytest.approx(60.0 * PLANT.gain_k_per_s)
    assert told["lag"].value == PLANT.lag_s


def test_a_plant_that_only_seems_to_show_at_rest_stays_hidden():
    loop = Watched()
    loop.live(2 * HOUR_S, NOISE)
    assert loop.live(2 * HOUR_S, PLANT)["gain"].value is None
