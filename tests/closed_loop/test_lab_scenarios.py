"""The default law on the Temperature Control Lab: every scenario, three boards, figures to meet.

It is told nothing of the board it meets. Power, film, room and the lag of the sensor differ.
"""

from dataclasses import dataclass

import pytest

from thermoctl.app.commands.compare import contender
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.studies.compare.bounds import bounds
from thermoctl.studies.compare.plants import FLEETS, plant
from thermoctl.studies.compare.play import play
from thermoctl.studies.compare.scenarios import SCENARIOS
from thermoctl.studies.compare.score import measured

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

_, TABLE = load(profile("aquarium")).loop()
LAW = contender("adaptive", TABLE)


@dataclass(frozen=True)
class Row:
    """The most that a measure may be, and the most its ratio to the bound may be."""

    at_most: dict[str, float]
    ratios: dict[str, float]


ROWS = {
    "warm-up": Row({"overshoot_k": 0.15}, {"settled_s": 2.5}),
    "regulation": Row({"largest_k": 0.15, "travel_per_min": 0.7}, {"deviation_k": 2.3}),
    "step": Row({"overshoot_k": 0.15, "settled_s": 120.0}, {}),
    "second-heater": Row({"largest_k": 0.25, "settled_s": 250.0}, {}),
}


def test_every_scenario_of_a_lab_has_figures_to_meet():
    assert set(ROWS) == set(FLEETS["tclab"].scenarios)


CREEPS = pytest.mark.xfail(
    strict=True,
    reason="the last .3 K of a warm-up take two minutes, in which a loss is learnt that was small "
    "when it was cold; measured 2.81 times the bound",
)


def cases():
    """Return every scenario on three boards; the law misses one figure on the first."""
    missed = {("warm-up", 0)}
    for case in ((name, seed) for name in ROWS for seed in range(3)):
        yield pytest.param(*case, marks=[CREEPS] if case in missed else [])


@pytest.mark.parametrize(("name", "seed"), list(cases()))
def test_the_default_law_meets_its_figures_on_a_lab(name, seed):
    where, scenario = plant("tclab", seed), SCENARIOS[name]
    trace = play(LAW.plan_for(where), where, scenario)
    figures, best, row = measured(trace), bounds(where, scenario), ROWS[name]
    print(name, seed, figures, best)
    assert trace.failure is None
    for measure, most in row.at_most.items():
        assert figures[measure] is not None, measure
        assert figures[measure] < most, measure
    for measure, most in row.ratios.items():
        assert figures[measure] is not None, measure
        assert figures[measure] < most * best[measure], measure


def test_a_lab_whose_heater_is_checked_stays_where_it_was_brought():
    # Seed 2: nine questions in twenty minutes, and 8.2 K, while its loss was taken for no answer.
    where = plant("tclab", 2)
    trace = play(LAW.plan_for(where), where, SCENARIOS["warm-up"])
    assert abs(trace.true_c[300:] - where.held_c).max() < 0.5
