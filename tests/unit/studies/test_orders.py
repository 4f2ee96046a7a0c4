"""What a record says of orders: laws of the weighing, and when it names no winner."""

import tomllib

import numpy as np
import pytest

from thermoctl.app.settings import load
from thermoctl.app.sim import default_profile, simulate
from thermoctl.estimation import Order
from thermoctl.studies import orders as orders_module
from thermoctl.studies.orders import EVIDENCE, USUAL, weigh
from thermoctl.studies.record import Columns, Record, RecordError

FEW = [Order(n, m, d) for n in (1, 2, 3) for m in (1, 2) for d in (1, 2, 3, 4)]
NAMES = Columns("y", "u", "t")


def record(u, y, drop=()):
    keep = np.setdiff1d(np.arange(len(y)), drop)
    return Record("made", keep.astype(float), np.asarray(u)[keep], np.asarray(y)[keep], NAMES)


def driven(a=(1.2, -0.5), b=0.8, delay=3, samples=1200, noise=0.3, seed=1, power=None):
    """An AR(2) plant with one delayed input: of two levels, or `power(y, t)` of its output."""
    rng = np.random.default_rng(seed)
    telegraph = np.repeat(rng.choice((0.0, 1.0), samples // 4 + 1), 4)[:samples]
    y, u = np.zeros(samples), np.zeros(samples)
    for t in range(samples):
        if t >= max(2, delay):
            y[t] = a[0] * y[t - 1] + a[1] * y[t - 2] + b * u[t - delay]
        y[t] += noise * rng.standard_normal()
        u[t] = telegraph[t] if power is None else power(y, t)
    return u, y


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_the_order_a_record_was_made_with_is_found(delay):
    weighing = weigh(record(*driven(delay=delay)), FEW)
    assert weighing.chosen == Order(2, 1, delay)
    assert weighing.settled is not None
    assert weighing.settled < 400
    assert weighing.trace[-1] == pytest.approx(weighing.posterior)


def test_probabilities_add_up_and_are_ranked():
    weighing = weigh(record(*driven()), FEW)
    chances = [chance for _, chance in weighing.ranked]
    assert sum(chances) == pytest.approx(1.0, abs=1e-12)
    assert chances == sorted(chances, reverse=True)
    assert {order for order, _ in weighing.ranked} == set(FEW)


@pytest.mark.parametrize(("gain", "offset"), [(40.0, 0.0), (1.0, 300.0), (1e-3, -5.0)])
def test_the_units_of_a_record_do_not_matter(gain, offset):
    u, y = driven()
    plain, other = weigh(record(u, y), FEW), weigh(record(100.0 * u, gain * y + offset), FEW)
    assert other.posterior == pytest.approx(plain.posterior, abs=1e-6)
    assert gain**2 * plain.R2 == pytest.approx(other.R2, rel=1e-6)


@pytest.mark.parametrize("noise", [0.03, 0.3, 3.0])
def test_the_noise_is_found_without_knowing_the_order(noise):
    weighing = weigh(record(*driven(noise=noise)), FEW)
    assert weighing.R2 / noise**2 == pytest.approx(1.0, rel=0.2)


def test_the_noise_of_a_short_record_is_not_told_too_small():
    """Nine parameters fitted to some sixty samples take a seventh of the squares with them."""
    found = [weigh(record(*driven(samples=66, seed=seed)), FEW).R2 for seed in range(60)]
    assert np.mean(found) / 0.3**2 == pytest.approx(1.05, abs=0.1)


def test_a_given_noise_is_used():
    assert weigh(record(*driven()), FEW, R2=0.5).R2 == 0.5


@pytest.mark.parametrize("R2", [None, 0.09])
def test_every_sample_counts_alike_without_a_floor(R2):
    assert weigh(record(*driven()), FEW, R2=R2).posterior.min() < 1e-9


def test_a_record_that_never_comes_to_rest_is_centred_where_it_would():
    rng = np.random.default_rng(3)
    u, y = np.repeat(rng.choice((0.5, 1.0), 100), 4), np.zeros(400)
    for t in range(2, 400):
        y[t] = 0.999 * y[t - 1] + 0.05 * u[t - 2] + 0.001 * rng.standard_normal()
    weighing = weigh(record(u, y), [Order(1, 1, d) for d in (1, 2, 3)])
    scaling = weighing.scaling
    assert scaling.u_centre == pytest.approx(0.001 * scaling.y_centre / 0.05, abs=0.03)
    assert scaling.u_centre < np.min(u) - 0.2
    assert weighing.chosen == Order(1, 1, 2)


def test_a_record_that_does_not_know_its_rest_is_centred_at_its_means():
    u, y = driven(b=0.0)
    scaling = weigh(record(u, y), FEW).scaling
    assert (scaling.u_centre, scaling.y_centre) == (np.mean(u), np.mean(y))


def test_samples_behind_a_gap_are_only_remembered():
    u, y = driven(samples=600)
    reach = 5
    whole, broken = weigh(record(u, y), FEW), weigh(record(u, y, drop=[300]), FEW)
    assert whole.samples == 600 - reach
    assert broken.samples == 599 - 2 * reach
    assert broken.chosen == whole.chosen


def test_linear_feedback_names_no_order():
    fed_back = record(*driven(power=lambda y, t: -0.3 * y[t], samples=2000))
    weighing = weigh(fed_back, FEW)
    assert weighing.chosen is None
    assert weighing.undecided.startswith("the input is not heard")


def test_an_input_that_rests_names_no_order():
    u, y = driven(b=0.0)
    assert weigh(record(np.full_like(u, 0.4), y), FEW).chosen is None


def test_an_input_that_does_nothing_names_no_order():
    assert weigh(record(*driven(b=0.0)), FEW).chosen is None


def held_by_the_paper():
    """Return the aquarium under the paper's law, whose feedback looks like a plant of its own."""
    content = tomllib.loads(default_profile().read_text(encoding="utf-8"))
    tank = content["loops"]["tank"]
    tank["controller"] = tank.pop("shadow")
    return content


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_an_hour_at_the_set_point_names_no_order(seed):
    cycles = list(simulate(load(held_by_the_paper()), 7200.0, seed))[3600:]
    u = [cycle.accepted_power for cycle in cycles]
    y = [cycle.step.measurement.temperature_c for cycle in cycles]
    weighing = weigh(record(u, y))
    assert weighing.ranked[0][1] > 0.95  # which is why probabilities alone will not do
    assert weighing.wide.evidence < EVIDENCE
    assert weighing.chosen is None


def test_orders_without_an_input_need_none_to_be_heard():
    weighing = weigh(record(*driven(b=0.0)), [Order(n, 0) for n in (1, 2, 3)])
    assert weighing.chosen == Order(2, 0)


def test_two_that_share_the_chances_leave_it_undecided():
    u, y = driven(b=0.0, a=(0.5, 0.0), samples=60)
    weighing = weigh(record(u, y), [Order(n, 0) for n in (1, 2, 3, 4, 5)], P0=0.01)
    assert weighing.ranked[0][1] < 0.5
    assert "the most probable has" in weighing.undecided
    assert weighing.settled is None


def test_an_order_at_the_edge_of_what_was_tried_is_told():
    heard = record(*driven(delay=4))
    assert weigh(heard, [Order(2, 1, d) for d in (1, 2, 3, 4)]).edges == ("delay 4",)
    assert weigh(heard, [Order(2, 1, d) for d in (3, 4, 5)]).edges == ()


def test_a_long_record_is_weighed_where_its_input_moves_most(monkeypatch):
    u, y = driven(samples=1500)
    still = np.concatenate((np.zeros(3000), u, np.zeros(3000)))
    monkeypatch.setattr(orders_module, "MOST_WEIGHED", 1000)
    weighing = weigh(record(still, np.concatenate((y[:1000].tolist() * 3, y, y, y))), FEW)
    assert weighing.samples == 1000
    assert weighing.index[0] > 2500
    assert weighing.index[-1] < 5000


def test_no_more_posteriors_are_kept_than_can_be_drawn(monkeypatch):
    monkeypatch.setattr(orders_module, "TRACE_LENGTH", 50)
    weighing = weigh(record(*driven()), FEW)
    assert len(weighing.trace) == len(weighing.index) <= 51
    assert weighing.index[-1] == 1199


def test_the_usual_candidates_differ_and_hold_each_other_in_pairs():
    assert len(set(USUAL)) == len(USUAL) == 72


def test_a_record_too_short_for_the_longest_candidate_says_how_long():
    with pytest.raises(RecordError, match=r"expected 120 samples with 29 before .* got 31"):
        weigh(record(*driven(samples=60)))


def test_an_output_that_never_changes_is_refused():
    with pytest.raises(RecordError, match="expected an output that changes"):
        weigh(record(np.arange(50.0), np.full(50, 20.0)), FEW)


@pytest.mark.parametrize(
    ("candidates", "message"), [([], "must not be empty"), (FEW[:2] + FEW[:1], "repeats another")]
)
def test_bad_candidates_are_refused(candidates, message):
    with pytest.raises(ValueError, match=message):
        weigh(record(*driven()), candidates)
