"""Orders weighed beside the loop: what counts, what is told, and that nothing of it steers."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.app.cycle_record import as_line
from thermoctl.app.daemon.order_service import OrderService, order_service
from thermoctl.app.daemon.order_watch import Finding, OrderWatch, watches_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, simulate
from thermoctl.errors import ConfigError
from thermoctl.estimation import Order
from thermoctl.signals import Command, Cycle, Estimate, Measurement, Mode, Quality, State, Step
from thermoctl.studies.orders import USUAL

ORDERS = [Order(n, 1, d) for n in (1, 2) for d in (1, 2, 3, 4)]
TABLE = {"setpoint_c": 37.5, "trip_above_c": 60.0}


def cycle(t, temperature_c, power, mode=Mode.MANUAL, loop="tank"):
    step = Step(
        t_s=float(t),
        measurement=Measurement(float(t), temperature_c),
        mode=mode,
        state=State.RUN,
        setpoint_c=37.5,
        command=Command(power, t + 2.5, "manual"),
        controller="manual",
        estimate=Estimate(np.zeros(1), np.eye(1)),
    )
    return Cycle(loop, step, power)


def cycles(samples=1500, delay=3, levels=(0.2, 0.8), mode=Mode.MANUAL, seed=1, hold=8, b=0.5):
    """A first-order tank behind a delay, with a power that takes turns at random."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice(levels, samples // hold + 1), hold)
    y = np.full(samples, 30.0)
    for t in range(delay, samples):
        y[t] = 20.0 + 0.98 * (y[t - 1] - 20.0) + b * u[t - delay] + 0.02 * rng.standard_normal()
    return [cycle(t, float(y[t]), float(u[t]), mode) for t in range(samples)]


def watched(run, watch=None):
    watch = watch or OrderWatch(ORDERS)
    return watch, [found for each in run if (found := watch.take(each)) is not None]


def test_an_order_is_found_once_the_input_was_heard():
    watch, found = watched(cycles())
    assert [each.order for each in found] == [Order(1, 1, 3)]
    assert watch.finding.probability >= 0.95


@pytest.mark.slow
def test_an_order_that_changes_is_told():
    run = cycles(2000)
    later = [
        replace(each, step=replace(each.step, t_s=each.step.t_s + 3000.0))
        for each in cycles(4000, delay=1, seed=2)
    ]
    _, found = watched([*run, *later])
    assert found[0].order == Order(1, 1, 3)
    assert found[-1].order == Order(1, 1, 1)


def test_power_that_a_law_makes_of_the_temperature_does_not_count():
    watch, found = watched(cycles(mode=Mode.AUTO))
    assert not found
    assert watch.finding is None


def test_power_at_its_bounds_counts_whoever_asked_for_it():
    _, found = watched(cycles(mode=Mode.AUTO, levels=(0.0, 0.6)), OrderWatch(ORDERS, 1.0, 0.6))
    assert [each.order for each in found] == [Order(1, 1, 3)]


def test_a_power_that_rests_finds_nothing():
    assert not watched(cycles(levels=(0.5,)))[1]


def test_nothing_is_weighed_before_the_input_was_heard():
    watch, found = watched(cycles(b=0.0, samples=2500))
    assert not found
    assert watch._bank is None


def test_cycles_without_a_reading_or_a_known_power_are_a_gap():
    run = cycles()
    for t in range(5, 1500, 200):
        step = run[t].step
        lost = Measurement(step.t_s, math.nan, Quality.MISSING)
        run[t] = replace(run[t], step=replace(step, measurement=lost))
        run[t + 50] = replace(run[t + 50], accepted_power=math.nan)
    assert [each.order for each in watched(run)[1]] == [Order(1, 1, 3)]


@pytest.mark.slow
def test_the_aquarium_at_its_set_point_finds_nothing_and_on_off_finds_its_delay():
    quiet = load({**bench_settings().in_force()})
    assert not watched(simulate(quiet, 7200.0, 1), OrderWatch(ORDERS))[1]
    content = quiet.in_force()
    content["loops"]["tank"]["controller"] = {"kind": "on-off"}
    _, found = watched(simulate(load(content), 5400.0, 1), OrderWatch(USUAL))
    assert found[-1].order.delay >= 8


def test_a_watch_that_fails_is_dropped_told_of_once_and_hurts_no_other():
    class Broken(OrderWatch):
        def take(self, cycle):
            raise ZeroDivisionError("a bug")

    told = []
    service = OrderService(
        {"tank": Broken(ORDERS), "other": OrderWatch(ORDERS)},
        lambda name, loop, **fields: told.append((name, loop, fields)),
    )
    for each in cycles():
        service.publish(each)
        service.step(replace(each, loop="other"))
    assert told[0] == ("orders.failed", "tank", {"error": "ZeroDivisionError: a bug"})
    assert [name for name, *_ in told] == ["orders.failed", "orders.changed"]
    assert service.keys("tank") == {}


def test_what_is_found_is_told_as_an_event_and_as_keys_of_json():
    told = []
    service = OrderService({"tank": OrderWatch(ORDERS)}, lambda *a, **k: told.append((a, k)))
    run = cycles()
    for each in run:
        service.step(each)
    ((names, fields),) = told
    assert names == ("orders.changed", "tank")
    assert (fields["n"], fields["m"], fields["delay"], fields["before"]) == (1, 1, 3, None)
    line = json.loads(as_line(run[-1], service.keys("tank")))
    assert line["order"] == [1, 1, 3]
    assert 0.95 <= line["order_probability"] <= 1.0
    assert service.keys("nobody") == {}


def test_publishing_does_no_work_in_the_thread_of_the_loop():
    class Counting(OrderWatch):
        taken = 0

        def take(self, cycle):
            Counting.taken += 1

    service = OrderService({"tank": Counting(ORDERS)}, lambda *a, **k: None)
    for each in cycles(50):
        service.publish(each)
    assert Counting.taken == 0
    service.turn()
    assert Counting.taken == 50


def test_the_thread_looks_at_what_is_published_and_ends():
    service = OrderService({"tank": OrderWatch(ORDERS)}, lambda *a, **k: None)
    service.start()
    service.publish(cycle(0, 30.0, 0.5))
    service.close()
    assert not service._thread.is_alive()


def test_a_configuration_names_candidates_or_takes_the_usual_ones():
    named = {"candidates": [[1, 1, 1], [2, 1, 3]]}
    loops = {
        "a": TABLE | {"orders": named, "power_max": 0.5},
        "b": TABLE | {"orders": {}},
        "c": TABLE | {"orders": named | {"enabled": False}},
        "d": TABLE,
    }
    settings = load({"loops": loops})
    watches = watches_for(settings.loops)
    assert list(watches) == ["a", "b"]
    assert watches["a"]._orders == (Order(1, 1, 1), Order(2, 1, 3))
    assert len(watches["b"]._orders) == 72
    assert order_service(settings.loops, lambda *a, **k: None) is not None
    assert order_service(load({"loops": {"d": TABLE}}).loops, lambda *a, **k: None) is None


@pytest.mark.parametrize(
    ("candidates", "message"),
    [
        ([], "must not be empty"),
        ([[1, 1, 1], [1, 1, 1]], "repeats another"),
        ([[0, 0, 1]], "must not both be 0"),
        ([[1, 1]], "candidates"),
        ([[1, 1, 121]], "120"),
        ([[11, 1, 1]], "10"),
        ("auto", "candidates"),
    ],
)
def test_bad_candidates_are_refused_with_their_key(candidates, message):
    with pytest.raises(ConfigError, match=message) as refusal:
        load({"loops": {"tank": TABLE | {"orders": {"candidates": candidates}}}})
    assert "orders" in str(refusal.value)


def test_a_finding_has_the_keys_of_json():
    assert Finding(Order(2, 1, 4), 0.97123).as_json() == {
        "order": [2, 1, 4],
        "order_probability": 0.9712,
    }
