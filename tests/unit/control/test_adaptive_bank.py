"""What a bank of corrected filters keeps, whatever it is told."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.control.adaptive import filters
from thermoctl.control.adaptive import path as path_room
from thermoctl.control.adaptive.bank import BLIND_S, Bank
from thermoctl.control.adaptive.coasting import Outlook, power_for
from thermoctl.control.adaptive.constants import Lags, Pace, Plants
from thermoctl.control.adaptive.evidence import Excitation, Gate, Noise, weighted
from thermoctl.control.adaptive.filters import BETA, D, T, X, Z
from thermoctl.control.adaptive.hypotheses import Hypotheses

BANK = Bank()


def warmed(samples=300, bank=BANK, seed=3, noise_k=0.01):
    """Return the belief after a warm-up and some steps of power, and the last reading."""
    rng = np.random.default_rng(seed)
    belief, water, sensor, q, u = bank.start(), 25.0, 25.0, 0.0, 0.0
    y = water
    for k in range(samples):
        belief = bank.observe(belief, y, u)
        u = 1.0 if k % 100 < 60 else 0.3
        q += (1.0 - math.exp(-1.0 / 14.0)) * (u - q)
        water += 0.036 * q - 0.009
        sensor += (1.0 - math.exp(-1.0 / 6.0)) * (water - sensor)
        y = sensor + noise_k * rng.standard_normal()
    return belief, y


def content(belief):
    """Return all numbers of a belief as one tuple of arrays and scalars."""
    return (belief.sample, belief.blind, belief.excitation, belief.noise, belief.gate,
            belief.outlook, *(part.tobytes() for part in (*belief.path, *belief.weights[:2],
                                                         belief.block)))  # fmt: skip


# -- values ---------------------------------------------------------------------------------------


def test_a_belief_stays_what_it_was_and_can_be_carried_on_twice():
    belief, y = warmed()
    before = content(belief)
    ways = [BANK.observe(belief, y + away, 0.5) for away in (0.0, 30.0, math.nan, 0.0)]
    assert content(belief) == before
    assert content(ways[0]) == content(ways[3])
    assert content(ways[0]) != content(ways[1])


def test_no_array_of_a_belief_can_be_written_to():
    belief, _ = warmed()
    for array in (belief.block, *belief.path, *belief.weights[:2]):
        with pytest.raises(ValueError, match="read-only"):
            array[..., 0] = 0.0


def test_a_reading_that_would_spoil_the_belief_raises_and_leaves_the_belief_good():
    belief = BANK.observe(BANK.start(), 25.0, 0.0)
    with (
        pytest.raises(ArithmeticError, match="expected a finite belief after 1e"),
        np.errstate(over="ignore", invalid="ignore"),
    ):
        BANK.observe(belief, 1e200, 0.0)
    assert np.isfinite(BANK.observe(belief, 25.0, 0.0).block).all()


# -- covariances ----------------------------------------------------------------------------------


def test_covariances_stay_symmetric_to_the_last_bit_and_positive():
    belief, y = warmed(20)
    rng = np.random.default_rng(0)
    for k in range(1500):
        y += 0.3 * rng.standard_normal() + (4.0 if k % 400 == 300 else 0.0)
        seen = y if rng.random() < 0.9 else math.nan
        belief = BANK.observe(belief, seen, rng.random())
        P = belief.block[:, :4]
        assert np.array_equal(P, P.swapaxes(0, 1))
        if k % 25 == 0:
            assert np.linalg.eigvalsh(P.transpose(2, 0, 1)).min() > 0.0
    assert belief.noise.samples > 1000


@pytest.mark.slow
def test_a_fortnight_of_quiet_regulation_wears_nothing_out():
    bank = Bank(period_s=60.0)
    belief = bank.start()
    rng = np.random.default_rng(1)
    for _ in range(20_000):
        belief = bank.observe(belief, 37.5 + 0.01 * rng.standard_normal(), 0.2)
    P = belief.block[:, :4].transpose(2, 0, 1)
    assert np.linalg.eigvalsh(P).min() > 0.0
    assert belief.outlook.coasting_c == pytest.approx(37.5, abs=0.05)
    assert np.abs(belief.block).max() < 100.0


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(-300.0, 2000.0) | st.just(math.nan) | st.just(math.inf),
            st.floats(-1.0, 2.0),
        ),
        min_size=1,
        max_size=60,
    ),
    st.sampled_from([0.05, 1.0, 30.0, 3600.0]),
)
def test_whatever_finite_readings_come_a_power_follows(samples, period_s):
    bank = Bank(period_s)
    belief = bank.start()
    for y, applied in samples:
        belief = bank.observe(belief, y, applied)
        if belief.outlook is not None:
            assert (
                0.0 <= power_for(belief.outlook, 37.5, 0.6, period_s, bank.bounds, applied) <= 1.0
            )
            x = belief.block[:, X]
            assert (x[BETA] >= bank.plants.gain_min_k_per_s * period_s).all()
            most = bank.plants.heat_max_k / bank.hypotheses.lag_s * period_s
            assert (x[BETA] <= most * (1.0 + 1e-12)).all()
    assert (belief.outlook is None) == (not any(math.isfinite(y) for y, _ in samples))


def test_heat_under_way_is_what_dead_time_and_heater_hold_however_long_it_was_added_up():
    h, rng = BANK.hypotheses, np.random.default_rng(6)
    way = path_room.at_rest(h)
    for power in rng.random(5000):
        way = path_room.pushed(way, h, power)
    waiting = np.array([way.powers[:dead].sum() for dead in h.dead])
    assert way.under_way == pytest.approx(waiting + h.element * way.heat, abs=1e-10)


# -- readings -------------------------------------------------------------------------------------


def test_before_the_first_reading_only_the_heat_under_way_is_known():
    belief = BANK.start()
    for _ in range(50):
        belief = BANK.observe(belief, math.nan, 1.0)
    assert belief.sample == -1
    assert belief.outlook is None
    assert belief.path.heat.max() == pytest.approx(1.0, abs=1e-3)
    assert BANK.observe(belief, 25.0, 1.0).sample == 0


@pytest.mark.parametrize("away_k", [-20.0, 6.5, 20.0])
@pytest.mark.parametrize("missing", [0, 3])
def test_a_first_reading_that_the_second_contradicts_begins_nothing(away_k, missing):
    right, wrong = BANK.start(), BANK.observe(BANK.start(), 25.0 + away_k, 0.0)
    for _ in range(missing):
        right, wrong = BANK.observe(right, math.nan, 0.0), BANK.observe(wrong, math.nan, 0.0)
    right, wrong = BANK.observe(right, 25.0, 0.0), BANK.observe(wrong, 25.0, 0.0)
    assert wrong.block.tobytes() == right.block.tobytes()
    assert wrong.noise == right.noise


def test_a_plant_that_moves_that_fast_is_begun_no_more_than_twice():
    belief = BANK.start()
    for n in range(6):
        belief = BANK.observe(belief, 25.0 + 5.0 * n, 1.0)
    assert belief.noise.samples == 5


def test_one_outlier_and_a_second_change_nothing_and_the_third_moves_the_water():
    belief, y = warmed(noise_k=0.003)
    reached = []
    for _ in range(3):
        coasting_c = belief.outlook.coasting_c
        belief = BANK.observe(belief, y - 5.0, 0.3)
        reached.append(belief.outlook.coasting_c - coasting_c)
    assert abs(reached[0]) < 0.05
    assert abs(reached[1]) < 0.05
    assert reached[2] < -4.0
    assert belief.gate.jumped
    assert belief.heard == 0.0


def test_a_jump_inflates_water_and_sensor_and_leaves_gain_and_loss_known():
    belief, y = warmed(noise_k=0.003)
    m = belief.weights.likeliest
    before = belief.block[..., m]
    for _ in range(3):
        belief = BANK.observe(belief, y - 5.0, 0.3)
    after = belief.block[..., m]
    assert after[T, T] > 2.0 * before[T, T]
    assert after[BETA, BETA] == pytest.approx(before[BETA, BETA], rel=0.05)
    assert after[BETA, X] == pytest.approx(before[BETA, X], rel=0.1)


def of_lags(belief):
    """Return the weight of every lag, all shapes together."""
    return belief.weights.share.reshape(Lags().count, -1).sum(axis=1)


def test_no_evidence_about_lags_is_heard_for_five_of_them_after_a_jump():
    belief, y = warmed(noise_k=0.003)
    for _ in range(3):
        belief = BANK.observe(belief, y - 5.0, 0.3)
    before, lag_s = of_lags(belief), BANK.hypotheses.lag_s[belief.weights.likeliest]
    silent = 0
    while np.allclose(of_lags(belief), before, rtol=0.0, atol=1e-9):
        belief = BANK.observe(belief, y - 5.0, float(silent % 20 < 10))
        silent += not belief.gate.jumped
        assert silent < 1000
    assert silent == pytest.approx(5.0 * lag_s, abs=12.0)


def with_a_rival(log_weight):
    """Return a belief with a rival, 1 K warmer, of `log_weight`; the rival, and what it expects."""
    belief, _ = warmed(noise_k=0.003)
    leader = belief.weights.likeliest
    rival, log = leader + 8, np.full(len(belief.weights.log), -30.0)
    log[leader], log[rival] = 0.0, log_weight
    full = belief.full.copy()
    full[:, X, rival] = full[:, X, leader] + np.array([1.0, 1.0, 0.0, 0.0])
    belief = belief._replace(full=full, x=full[:, X], weights=weighted(log), gains=None)
    return belief, rival, BANK.predict(belief, 1.0).x.item(Z, rival)


def test_a_reading_that_one_about_as_likely_foresaw_tells_the_two_apart():
    belief, rival, y = with_a_rival(-2.0)
    after = BANK.observe(belief, y, 1.0)
    assert after.gate == belief.gate
    assert after.heard > 0.0
    assert after.weights.likeliest == rival


def test_a_reading_that_only_the_unlikely_foresaw_is_an_outlier():
    belief, _, y = with_a_rival(-6.0)
    assert BANK.observe(belief, y, 1.0).gate.outside == 1


def test_before_any_evidence_no_reading_tells_lags_apart():
    belief, _, y = with_a_rival(-2.0)
    equal = weighted(np.zeros(len(belief.weights.log)))
    nobody = belief._replace(weights=equal)
    leader, rival = (BANK.predict(nobody, 1.0).x.item(Z, j) for j in (0, belief.weights.likeliest))
    assert abs(rival - leader) < 0.5 < abs(y - leader)
    assert BANK.observe(nobody, y, 1.0).gate.outside == 1


def test_while_a_disturbance_is_learnt_a_reading_tells_no_lags_apart():
    belief, _, y = with_a_rival(-2.0)
    learning = belief.drifting._replace(silent_until=belief.sample + 10)
    assert BANK.observe(belief._replace(drifting=learning), y, 1.0).gate.outside == 1


@pytest.mark.parametrize(("heater_s", "sensor_s", "shape"), [(30.0, 6.0, 1), (6.0, 30.0, 2)])
def test_water_that_jumps_tells_a_slow_sensor_from_a_slow_heater(heater_s, sensor_s, shape):
    rng, belief = np.random.default_rng(4), BANK.start()
    water = sensor = y = 25.0
    q = u = 0.0
    shares = []
    for k in range(500):
        if k == 400:
            water -= 3.0
        belief = BANK.observe(belief, y, u)
        u = 1.0 if k % 100 < 60 else 0.3
        q += (1.0 - math.exp(-1.0 / heater_s)) * (u - q)
        water += 0.036 * q - 0.009
        sensor += (1.0 - math.exp(-1.0 / sensor_s)) * (water - sensor)
        y = sensor + 0.01 * rng.standard_normal()
        shares.append(belief.weights.share.reshape(Lags().count, -1).sum(axis=0)[shape])
    assert shares[399] < 0.9  # until then, it is a guess
    assert shares[440] > 0.99


def test_when_the_heat_has_arrived_gain_and_loss_are_uncertain_together():
    belief, _ = warmed(60)
    block, due = belief.block.copy(), BANK.hypotheses.lag_s < 30.0
    before, heat = block.copy(), belief.path.heat
    filters.loosened(block, heat, 0.08 * due)
    changed = np.zeros((4, 5), dtype=bool)
    changed[D:, D:X] = True
    assert np.array_equal(block[~changed], before[~changed])
    assert np.array_equal(block[..., ~due], before[..., ~due])
    added = block[D, D] - before[D, D]
    assert added[due] == pytest.approx((0.08 * (heat * before[BETA, X])[due]) ** 2)
    difference, known = (P[D, D] - 2.0 * P[D, BETA] + P[BETA, BETA] for P in (block, before))
    assert difference == pytest.approx(known, rel=1e-6)


def test_the_loss_may_drift_faster_while_the_power_is_far_from_what_holds_the_water():
    h, block = BANK.hypotheses, filters.start(BANK.hypotheses, 25.0)
    heat = np.zeros(len(h))
    calm, restless = (
        filters.predicted(block, heat, BANK.constants, unrest)[D, D] - block[D, D]
        for unrest in (0.0, 0.8)
    )
    assert restless / calm == pytest.approx(np.full(len(h), (1.0 + Plants().unrest * 0.8) ** 2))


def test_after_a_long_gap_the_water_begins_anew_and_the_gain_is_kept():
    belief, y = warmed()
    gain = belief.outlook.gain
    for _ in range(int(BLIND_S) + 1):
        belief = BANK.observe(belief, math.nan, 0.0)
    stood = belief.block
    belief = BANK.observe(belief, math.nan, 0.0)
    assert np.array_equal(belief.block, stood)
    belief = BANK.observe(belief, y - 20.0, 0.0)
    assert belief.gate.outside == 0
    assert belief.outlook.coasting_c == pytest.approx(y - 20.0, abs=0.3)
    assert belief.outlook.gain == pytest.approx(gain, rel=0.1)


def test_a_gap_nobody_knows_of_leaves_no_heat_under_way():
    belief, y = warmed()
    assert belief.path.heat.max() > 0.1
    belief = BANK.observe(BANK.lost(belief), y + 3.0, 0.0)
    assert belief.path.heat.max() == 0.0
    assert belief.outlook.coasting_c == pytest.approx(y + 3.0, abs=0.3)


# -- noise, excitation, gate ----------------------------------------------------------------------


def test_noise_is_told_from_second_differences_and_not_from_warming():
    rng = np.random.default_rng(5)
    noise = Noise()
    for k in range(4000):
        noise = noise.after(25.0 + 0.04 * k + 0.02 * rng.standard_normal())
    assert math.sqrt(noise.variance) == pytest.approx(0.02, rel=0.1)


def test_a_noise_below_three_millikelvin_is_not_believed():
    noise = Noise()
    for _ in range(3000):
        noise = noise.after(25.0)
    assert noise.variance < 1e-6
    assert noise.believed == 1e-5


def test_one_wild_reading_moves_the_noise_no_more_than_three_deviations_do():
    noise = Noise(variance=0.004, last_c=25.0, before_last_c=25.0, samples=1000)
    assert noise.after(1e6).variance == pytest.approx(0.004 * (1.0 + 8.0 * 0.005))


@pytest.mark.parametrize(("power", "share"), [(0.24, 0.0), (0.275, 0.5), (0.31, 1.0), (0.9, 1.0)])
def test_power_within_the_dead_zone_proves_nothing(power, share):
    assert Excitation(mean_power=0.2).after(power, 1.0).share == pytest.approx(share)


def test_a_sample_without_a_reading_does_not_reset_the_count_of_outliers():
    belief, y = warmed(noise_k=0.003)
    belief = BANK.observe(belief, y + 5.0, 0.3)
    belief = BANK.observe(belief, math.nan, 0.3)
    assert belief.gate == Gate(1)
    assert BANK.observe(belief, y, 0.3).gate.outside == 0


def test_no_log_weight_falls_below_the_floor_and_shares_add_up_to_one():
    belief, _ = warmed(900)
    assert belief.weights.log.max() == 0.0
    assert belief.weights.log.min() == -30.0
    assert belief.weights.share.sum() == pytest.approx(1.0)
    assert belief.weights.likeliest == belief.weights.log.argmax()


def test_a_wrong_hypothesis_at_the_floor_comes_back_when_it_is_right():
    belief, _ = warmed(900)
    slow = BANK.hypotheses.lag_s > 60.0
    weights = belief.weights._replace(
        log=np.where(slow, 0.0, -30.0), share=slow / slow.sum(), likeliest=int(slow.argmax())
    )
    assert belief.outlook.lag_s < 30.0
    misled, other = belief._replace(weights=weights), belief
    water = sensor = float(belief.block[Z, X, belief.weights.likeliest])
    q = 0.3
    for k in range(120):
        u = float(k % 40 < 20)
        q += (1.0 - math.exp(-1.0 / 14.0)) * (u - q)
        water += 0.036 * q - 0.009
        sensor += (1.0 - math.exp(-1.0 / 6.0)) * (water - sensor)
        misled, other = (BANK.observe(each, sensor, u) for each in (misled, other))
    assert misled.outlook.lag_s < 30.0
    assert other.outlook.lag_s < 30.0


# -- the law --------------------------------------------------------------------------------------


def test_heat_under_way_counts_as_if_it_had_arrived():
    belief, _ = warmed(100)
    heated, rested = (BANK.observe(belief, math.nan, u) for u in (1.0, 0.0))
    h = BANK.hypotheses
    in_heater = h.element_step * (1.0 + h.element)  # arrived in this period, and still to come
    under_way = np.where(h.dead > 0, 1.0, in_heater)
    expected_k = float(belief.weights.share @ (belief.block[BETA, X] * under_way))
    assert heated.outlook.coasting_c - rested.outlook.coasting_c == pytest.approx(expected_k)


def test_at_rest_at_the_set_point_the_power_is_the_holding_power():
    outlook = Outlook(coasting_c=37.5, holding_power=0.2, lag_s=20.0, gain=0.036)
    assert power_for(outlook, 37.5, 0.6, 1.0, (0.0, 1.0), before=0.2) == 0.2


@pytest.mark.parametrize(
    ("lag_s", "calmness", "period_s", "Tc_s"),
    [(20.0, 0.6, 1.0, 12.0), (20.0, 1.2, 1.0, 24.0), (3.0, 0.6, 1.0, 3.0), (3.0, 0.6, 10.0, 15.0)],
)
def test_an_error_is_to_be_removed_within_tc(lag_s, calmness, period_s, Tc_s):
    outlook = Outlook(coasting_c=37.45, holding_power=0.2, lag_s=lag_s, gain=0.036)
    coasting_c, before = outlook.coasting_c, 0.2
    left_k = []
    for _ in range(400):
        now = outlook._replace(coasting_c=coasting_c)
        power = power_for(now, 37.5, calmness, period_s, (-9.0, 9.0), before)
        under_way = 0.036 * Pace().smoothness * Tc_s * (power - 0.2)  # of the power's own lag
        coasting_c += 0.036 * period_s * (power - 0.2)
        left_k.append(37.5 - coasting_c - under_way)
        before = power
    decay = 1.0 - period_s / Tc_s
    assert left_k[:9] == pytest.approx([0.05 * decay ** (k + 1) for k in range(9)])
    assert before == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("period_s", {"period_s": 0.0}),
        ("period_s", {"period_s": math.nan}),
        ("period_s", {"period_s": True}),
        ("u_min", {"u_min": 0.1}),
        ("u_min", {"u_min": math.nan}),
        ("u_max", {"u_max": 0.0}),
        ("u_max", {"u_max": "1"}),
    ],
)
def test_a_bad_argument_is_refused_by_name(name, arguments):
    with pytest.raises(ValueError, match=f"{name} must .*got"):
        Bank(**arguments)


def test_power_that_has_far_to_go_is_at_its_limit_at_once_and_noise_moves_it_little():
    cold = Outlook(coasting_c=35.0, holding_power=0.2, lag_s=20.0, gain=0.036)
    assert power_for(cold, 37.5, 0.4, 1.0, (0.0, 1.0), before=0.2) == 1.0
    noisy = cold._replace(coasting_c=37.495)
    unsmoothed = 0.005 / (0.036 * 0.4 * 20.0)
    moved = power_for(noisy, 37.5, 0.4, 1.0, (0.0, 1.0), before=0.2) - 0.2
    assert moved == pytest.approx(unsmoothed / (1.0 + Pace().smoothness * 8.0))


@pytest.mark.parametrize(
    ("lag_sd_s", "gain", "times"),
    [(0.0, 0.036, 1.0), (0.0, 0.16, 2**0.5), (7.0, 0.032, 51**0.5 * 0.2), (2.0, 0.3, 3.0)],
)
def test_what_a_mistaken_lag_may_cost_makes_the_power_calmer_up_to_three_times(
    lag_sd_s, gain, times
):
    near = Outlook(37.4, 0.2, 20.0, gain, lag_sd_s=lag_sd_s)
    Tc_s = times * 0.4 * 20.0
    moved = power_for(near, 37.5, 0.4, 1.0, (-9.0, 9.0), before=0.2) - 0.2
    expected = 0.1 / (gain * Tc_s) / (1.0 + Pace().smoothness * Tc_s)
    assert moved == pytest.approx(expected)


def counted(surplus, gain=0.036, least=0.0):
    """Return as how much power a surplus in the heater counts, well within the limits."""
    near = Outlook(37.5, 0.5, 20.0, gain, heater_k=gain)
    asked = power_for(near._replace(surplus=surplus), 37.5, 0.4, 1.0, (least, 1.0), before=0.5)
    Tc_s = 0.4 * 20.0 * max(gain * 2**0.5 / 0.16, 1.0)
    return surplus - (asked - 0.5) * (1.0 + Pace().smoothness * Tc_s) * Tc_s


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_heat_in_the_heater_counts_twice_at_rest_and_in_part_on_the_move(sign):
    assert counted(sign * 0.05) == pytest.approx(sign * 2.2 * 0.05)
    assert counted(sign * 0.2) == pytest.approx(sign * 2.2 * 0.08)
    assert counted(sign * 0.8) == pytest.approx(sign * 0.6 * 0.8)


def test_on_the_move_more_of_it_counts_the_more_is_under_way():
    assert counted(0.8, gain=0.12) == pytest.approx(0.8)
    assert counted(0.8, gain=0.3) == pytest.approx(1.4 * 0.8)
    assert counted(0.8, gain=0.06, least=-1.0) == pytest.approx(0.8)  # by a cooler as well


@pytest.mark.parametrize(("off_k", "bounds", "left_k"), [
    (-0.3, (0.0, 1.0), 0.1), (-0.1, (0.0, 1.0), 0.0), (0.03, (0.0, 1.0), -0.03),
    (0.3, (-1.0, 1.0), -0.1), (0.1, (-1.0, 1.0), 0.0),
])  # fmt: skip
def test_what_hypotheses_do_not_agree_upon_is_not_acted_on(off_k, bounds, left_k):
    told = Outlook(37.5 + off_k, 0.2, 20.0, 0.12, spread_k=0.25)
    Tc_s = 0.75 * 2**0.5 * 0.4 * 20.0
    moved = power_for(told, 37.5, 0.4, 1.0, bounds, before=0.2) - 0.2
    assert moved == pytest.approx(left_k / (0.12 * Tc_s * (1.0 + Pace().smoothness * Tc_s)))


def test_the_spread_is_that_of_the_coasting_temperatures():
    belief, _ = warmed(40)
    h, x, path = BANK.hypotheses, belief.block[:, X], belief.path
    holding = np.clip(x[D] / x[BETA], 0.0, 1.0)
    pending = np.array([path.powers[:dead].sum() for dead in h.dead])
    under_way = h.element * (path.heat - holding) + pending - h.dead * holding
    coasting = x[0] + x[BETA] * under_way
    spread = np.sqrt(np.cov(coasting, aweights=belief.weights.share, ddof=0))
    assert spread > 0.01
    assert belief.outlook.spread_k == pytest.approx(spread, rel=1e-6)


@pytest.mark.parametrize("period_s", [5.0, 10.0])
def test_within_a_period_heater_and_sensor_are_those_of_a_hundred_short_ones(period_s):
    h, fine = Hypotheses.at_period(period_s), Hypotheses.at_period(period_s / 100.0)
    block = filters.start(h, 25.0)
    way = path_room.pushed(path_room.at_rest(h), replace(h, dead=np.zeros_like(h.dead)), 1.0)
    water, sensor = (
        filters.predicted(block, way.mean, filters.per_period(h, Plants(), 0.0, 1.0))[:2, X] - 25.0
    )
    q, heat, shown = np.zeros((3, len(h)))
    for k in range(100):
        before, q = q, q + fine.element_step * (1.0 - q)
        heat = heat + 0.5 * (before + q)
        shown = shown + fine.sensor_step * ((k + 0.5) / 100.0 - shown)  # of water warming evenly
    assert water == pytest.approx(block[BETA, X] * heat / 100.0, rel=0.01)
    assert sensor == pytest.approx(water * shown, rel=0.01)


@pytest.mark.parametrize("proof", [0.0, 0.4])
def test_a_known_gain_moves_by_the_share_of_the_proof_and_stays_that_much_less_sure(proof):
    belief, y = warmed()
    block = belief.block.copy()
    block[BETA, BETA, ::2] += 0.05**2
    unknown = block[BETA, BETA] > (Plants().known_share * block[BETA, X]) ** 2
    assert 10 < unknown.sum() < len(unknown) - 10
    whole, _, _ = filters.corrected(block, y + 0.03, 1e-4, BANK.constants)
    part, _, _ = filters.corrected(block, y + 0.03, 1e-4, BANK.constants, proof)
    assert np.array_equal(part[..., unknown], whole[..., unknown])
    same = np.ones((4, 5), dtype=bool)
    same[BETA, [BETA, X]] = False
    assert np.array_equal(part[same], whole[same])
    moved, moved_whole = ((each - block)[BETA, X, ~unknown] for each in (part, whole))
    assert moved == pytest.approx(proof * moved_whole, rel=1e-9)
    surer, surer_whole = ((block - each)[BETA, BETA, ~unknown] for each in (part, whole))
    assert surer == pytest.approx(proof * (2.0 - proof) * surer_whole, rel=1e-6, abs=1e-18)


def test_hypotheses_cover_three_seconds_to_two_and_a_half_minutes_in_four_shapes():
    h = Hypotheses.at_period(1.0)
    assert len(h) == 96
    assert h.lag_s.min() == pytest.approx(3.0)
    assert h.lag_s.max() == pytest.approx(150.0)
    assert np.unique(np.round(h.lag_s, 6)).size == 24
    assert (h.element[0::4] < h.element[1::4]).all()
    assert (h.sensor_step[2::4] < h.sensor_step[0::4]).all()  # the slowest sensor is the third
    pipe = h.element[3::4] * h.period_s, h.lag_s[3::4]
    assert pipe[0] == pytest.approx(np.minimum(0.31, 20.0 * 0.31 / 0.82 / pipe[1]) * pipe[1])
    assert h.dead[3::4] == pytest.approx(np.maximum(0.18 * pipe[1], pipe[1] - 20.0), abs=0.5)
    assert D == 2


def test_a_gain_that_is_hardly_known_is_taken_to_be_larger():
    near = Outlook(coasting_c=37.4, holding_power=0.2, lag_s=20.0, gain=0.036)
    known = power_for(near, 37.5, 0.35, 1.0, (0.0, 1.0), 0.2)
    sure = power_for(near._replace(gain_sd=0.2 * 0.036), 37.5, 0.35, 1.0, (0.0, 1.0), 0.2)
    vague = power_for(near._replace(gain_sd=1.25 * 0.036), 37.5, 0.35, 1.0, (0.0, 1.0), 0.2)
    assert sure == known
    assert vague - 0.2 == pytest.approx((known - 0.2) / 2.0)


@pytest.mark.slow
def test_starts_a_tenth_of_a_kelvin_below_the_set_point_pass_it_by_less_in_the_mean():
    passed_k = []
    for seed in range(16):
        bank, power, most_c, heat = Bank(), 0.0, 0.0, 0.0
        belief, water_c, sensor_c = bank.start(), 37.4, 37.4
        rng = np.random.default_rng(seed)
        for _ in range(600):
            heat += (1 - math.exp(-1 / 14)) * (power - heat)
            water_c += 0.036 * heat - 0.009
            sensor_c += (1 - math.exp(-1 / 6)) * (water_c - sensor_c)
            belief = bank.observe(belief, sensor_c + 0.01 * rng.standard_normal(), power)
            power = power_for(belief.outlook, 37.5, 0.35, 1.0, bank.bounds, power)
            most_c = max(most_c, water_c)
        assert abs(water_c - 37.5) < 0.05
        passed_k.append(most_c - 37.5)
    assert np.mean(passed_k) < 0.1  # measured .088, and .136 at most
    assert max(passed_k) < 0.15
