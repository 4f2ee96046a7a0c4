import itertools
import math
import re

import numpy as np
import pytest

from thermoctl.estimation import Order
from thermoctl.model.arx import Arx
from thermoctl.studies import replay as replay_module
from thermoctl.studies.laws import parse_law
from thermoctl.studies.orders import weigh
from thermoctl.studies.record import Columns, Record, RecordError
from thermoctl.studies.replay import FEWEST_SCORED, TRACE_LENGTH, replay
from thermoctl.studies.scaled import Scaled

THETA = (-1.5, 0.56, 0.3, 0.2)
ORDER = Arx(2, 2, 1)
KALMAN, LEAST_SQUARES = parse_law("nkf"), parse_law("rls")


def recorded(
    samples=2000, sigma=0.05, seed=3, theta=THETA, offset=0.0, unit_y=1.0, unit_u=1.0, drop=()
):
    """A record of O21 (1) with n = m = 2, d = 1 and a random telegraph as input."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice((-1.0, 1.0), size=samples // 5 + 1), 5)[:samples]
    y = np.zeros(samples)
    for t in range(2, samples):
        phi = (-y[t - 1], -y[t - 2], u[t - 1], u[t - 2])
        y[t] = np.dot(theta, phi) + sigma * rng.standard_normal()
    keep = np.setdiff1d(np.arange(samples), drop)
    t_s = keep.astype(float)
    names = Columns("y", "u", "t")
    return Record("made", t_s, unit_u * u[keep], offset + unit_y * y[keep], names)


def only(result):
    (score,) = result.scores
    return score


@pytest.mark.slow
def test_true_parameters_lie_within_their_error_bars():
    misses = []
    for seed in range(20):
        score = only(replay(recorded(seed=seed), ORDER, [KALMAN]))
        misses += list((np.array(score.theta) - THETA) / score.theta_sd)
    assert np.std(misses) == pytest.approx(1.0, abs=0.35)
    assert np.mean(np.abs(misses) < 2.0) > 0.88


def test_with_the_right_model_only_the_noise_is_left_and_it_is_white():
    result = replay(recorded(), ORDER, [KALMAN])
    score = only(result)
    assert score.rms_error == pytest.approx(0.05, rel=0.05)
    assert score.whiteness_p > 0.05
    assert score.r2 > 0.98
    assert score.rms_error < result.conditions.persistence_rms


def test_a_model_that_is_too_small_leaves_innovations_that_are_not_white():
    assert only(replay(recorded(), Arx(1, 1, 1), [KALMAN])).whiteness_p < 1e-6


@pytest.mark.parametrize("sigma", [0.01, 0.1, 1.0])
def test_noise_is_estimated_from_the_record(sigma):
    conditions = replay(recorded(sigma=sigma), ORDER, [KALMAN]).conditions
    estimated_variance = conditions.R2
    assert estimated_variance == pytest.approx(sigma**2, rel=0.15)
    assert conditions.R2_source.startswith("estimated")


def test_a_few_outliers_hardly_move_the_estimated_noise():
    clean = recorded()
    y = clean.y.copy()
    y[300::400] += 5.0
    spoilt = Record("made", clean.t_s, clean.u, y, clean.names)
    R2 = [replay(record, ORDER, [KALMAN]).conditions.R2 for record in (clean, spoilt)]
    assert R2[1] < 2.0 * R2[0]  # the mean square of the same errors grows a hundredfold


def test_a_given_noise_is_used_and_said():
    conditions = replay(recorded(), ORDER, [KALMAN], R2=0.5).conditions
    assert (conditions.R2, conditions.R2_source) == (0.5, "given")


def test_least_squares_without_forgetting_is_the_kalman_filter_without_drift():
    result = replay(recorded(), ORDER, [KALMAN, LEAST_SQUARES])
    kalman, least_squares = result.scores
    np.testing.assert_allclose(kalman.theta, least_squares.theta, rtol=1e-9)
    np.testing.assert_allclose(kalman.theta_sd, least_squares.theta_sd, rtol=1e-9)
    np.testing.assert_allclose(
        result.traces[0].innovation_sd, result.traces[1].innovation_sd, rtol=1e-9
    )


def test_scores_follow_the_units_of_the_record():
    plain = only(replay(recorded(), ORDER, [KALMAN]))
    scaled = only(replay(recorded(unit_y=10.0, unit_u=100.0), ORDER, [KALMAN]))
    units = np.array((1.0, 1.0, 0.1, 0.1))
    assert scaled.rms_error == pytest.approx(10.0 * plain.rms_error, rel=1e-9)
    assert scaled.r2 == pytest.approx(plain.r2, rel=1e-9)
    assert scaled.whiteness_p == pytest.approx(plain.whiteness_p, rel=1e-6)
    np.testing.assert_allclose(scaled.theta, units * plain.theta, rtol=1e-9)
    np.testing.assert_allclose(scaled.theta_sd, units * plain.theta_sd, rtol=1e-9)


def test_the_mean_is_removed_unless_it_is_to_be_kept():
    plain = only(replay(recorded(), ORDER, [KALMAN]))
    lifted = replay(recorded(offset=40.0), ORDER, [KALMAN])
    np.testing.assert_allclose(only(lifted).theta, plain.theta, rtol=1e-6)
    assert lifted.conditions.mean_removed
    kept = replay(recorded(offset=40.0), ORDER, [KALMAN], keep_mean=True)
    conditions = kept.conditions
    assert not conditions.mean_removed
    assert (conditions.y_centre, conditions.y_scale) == (0.0, 1.0)
    assert (conditions.u_centre, conditions.u_scale) == (0.0, 1.0)
    # Without a constant in the model the parameters must bend to carry the mean.
    assert np.abs(np.array(only(kept).theta) - THETA).max() > 0.02


def test_regressors_are_those_of_the_model():
    record = recorded(samples=400)
    order = Arx(2, 3, 2)
    seen = [(phi, y) for _, phi, y in Scaled.of(record, record.y, record.u, order).samples()]
    assert len(seen) == 400 - 4
    for t, (phi, y) in enumerate(seen, start=4):
        expected = order.regressor(record.y[:t][::-1], record.u[:t][::-1])
        np.testing.assert_allclose(phi, expected, rtol=1e-12)
        assert y == pytest.approx(record.y[t])


def test_no_regressor_reaches_across_a_gap():
    record = recorded(samples=400, drop=range(200, 203))
    trace = replay(record, ORDER, [KALMAN]).traces[0]
    unseen = np.flatnonzero(np.isnan(trace.innovation))
    assert unseen.tolist() == [0, 1, 200, 201]


def test_a_gap_hardly_costs_anything():
    whole = only(replay(recorded(), ORDER, [KALMAN]))
    torn = only(replay(recorded(drop=range(500, 540)), ORDER, [KALMAN]))
    assert torn.rms_error == pytest.approx(whole.rms_error, rel=0.05)
    np.testing.assert_allclose(torn.theta, whole.theta, atol=0.05)


def test_first_samples_are_learnt_from_but_not_scored():
    result = replay(recorded(), ORDER, [KALMAN])
    first = result.conditions.scored_from
    assert result.conditions.scored == len(result.record.t_s) - first
    e = result.traces[0].innovation[first:]
    assert only(result).rms_error == pytest.approx(np.sqrt(np.mean(e**2)), rel=1e-12)


def test_a_law_that_runs_away_is_no_praise():
    record = recorded(samples=1000, sigma=0.3)
    quiet = Record(
        "quiet", record.t_s, np.where(record.t_s < 100, record.u, 1.0), record.y, record.names
    )
    score = only(replay(quiet, Arx(2, 3, 1), [parse_law("vff:1,forgetting_min=0.01")]))
    assert score.r2 < 0.0
    assert np.isnan(score.whiteness_p)


def test_time_of_an_update_is_the_median_and_in_microseconds():
    ticks = itertools.count()
    score = only(replay(recorded(), ORDER, [KALMAN], timer=lambda: 5e-6 * next(ticks)))
    assert score.us_per_sample == pytest.approx(5.0)


def test_a_long_record_keeps_a_trace_that_can_be_drawn():
    trace = replay(recorded(samples=3 * TRACE_LENGTH), ORDER, [KALMAN]).traces[0]
    assert len(trace.index) <= TRACE_LENGTH + 1
    assert trace.theta.shape == trace.theta_sd.shape == (len(trace.index), 4)


def test_an_output_that_never_changes_is_refused():
    record = Record("flat", np.arange(50.0), np.arange(50.0), np.full(50, 20.0), Columns("y", "u"))
    with pytest.raises(RecordError, match="y is 20 throughout"):
        replay(record, ORDER, [KALMAN])


def test_an_input_that_never_changes_is_lived_with():
    rng = np.random.default_rng(5)
    y = np.cumsum(rng.standard_normal(300))
    record = Record("still", np.arange(300.0), np.ones(300), y, Columns("y", "u"))
    score = only(replay(record, Arx(1, 1, 1), [KALMAN]))
    assert score.theta[1] == 0.0
    assert score.theta[0] == pytest.approx(-1.0, abs=0.1)


def test_a_record_that_is_too_short_is_refused_with_the_numbers():
    with pytest.raises(RecordError, match=f"at least {FEWEST_SCORED} samples to score, 8 of 10"):
        replay(recorded(samples=10), ORDER, [KALMAN])


@pytest.mark.parametrize("name", ["R2", "P0"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, 1e60, 1e-60])
def test_variances_must_be_such_that_a_law_can_use_them(name, value):
    message = f"expected {name} from .*, got {re.escape(format(value, 'g'))}"
    with pytest.raises(RecordError, match=message):
        replay(recorded(samples=100), ORDER, [KALMAN], **{name: value})
    with pytest.raises(RecordError, match=message):
        weigh(recorded(samples=100), [Order(1, 1, 1)], **{name: value})


@pytest.mark.parametrize("law", ["rls:1e-9", "nkf:R1=1e49", "ckf", "vff:1e9", "vff:1e-9"])
@pytest.mark.parametrize("given", [{"R2": 1e38}, {"R2": 1e-38}, {"P0": 1e9}, {"P0": 1e-9}])
def test_variances_at_their_limits_are_lived_with(law, given):
    assert replay(recorded(samples=100), ORDER, [parse_law(law)], **given).scores[0].name == law


@pytest.mark.parametrize("unit_y", [1e-200, 1e-160])
def test_an_output_too_small_to_be_squared_is_refused(unit_y):
    with pytest.raises(RecordError, match="expected an output that changes"):
        replay(recorded(200, unit_y=unit_y), ORDER, [KALMAN])


def test_too_few_innovations_are_no_verdict_and_the_reason_is_given():
    score = only(replay(recorded(20), ORDER, [KALMAN]))
    assert np.isnan(score.whiteness_p)
    assert score.whiteness_unknown == "expected at least 20 innovations, got 17"
    assert only(replay(recorded(200), ORDER, [KALMAN])).whiteness_unknown is None


def test_a_law_that_ran_away_gave_up_where_it_first_lost_its_way():
    rng = np.random.default_rng(4)
    u, y = np.where(np.arange(2000) < 600, rng.choice((0.0, 1.0), 2000), 1.0), np.zeros(2000)
    for t in range(1, 2000):
        y[t] = 0.95 * y[t - 1] + u[t - 1] + 0.1 * rng.standard_normal()
    record = Record("made", np.arange(2000.0), u, y, Columns("y", "u", "t"))
    result = replay(record, Arx(2, 3, 1), [parse_law("vff:10"), KALMAN])
    lost, kept = result.traces
    sane = np.abs(lost.innovation) <= replay_module.BEYOND * np.ptp(y)
    sane[lost.index[~np.isfinite(lost.theta_sd).all(axis=1)]] = False
    assert 600 < lost.gave_up < 2000
    assert sane[result.conditions.scored_from : lost.gave_up].all()
    assert not sane[lost.gave_up]
    assert result.scores[0].whiteness_unknown == "it foresaw nothing"
    assert kept.gave_up is None
