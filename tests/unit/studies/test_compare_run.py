"""Runs: the same plant for everyone, nothing twice, nothing lost."""

import json
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.control.manual import Manual
from thermoctl.control.on_off import OnOff
from thermoctl.plant.parameters import TankParameters
from thermoctl.studies.compare.baselines import SimplePid, simc
from thermoctl.studies.compare.plants import FLEETS, FleetError, plant
from thermoctl.studies.compare.play import play
from thermoctl.studies.compare.run import BOUND, Contender, Job, finished, jobs_for
from thermoctl.studies.compare.scenarios import SCENARIOS, SETPOINT, Happening, Scenario
from thermoctl.studies.compare.store import Result, Store, StoreError

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

_, TABLE = load(profile("aquarium")).loop()
PLAN = plan_for(TABLE)
BRIEF = replace(SCENARIOS["warm-up"], judged_s=20.0)


def thermostat(where):
    return replace(PLAN, controller=OnOff(0.1))


@dataclass
class Counting:
    """A contender's plans, counted."""

    seeds: list = field(default_factory=list)

    def __call__(self, where):
        self.seeds.append(where.seed)
        return thermostat(where)


def jobs(contender, seeds=range(3)):
    return [Job.of(contender, plant("rig", seed), BRIEF, 1.0) for seed in seeds]


# -- plants ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("fleet", FLEETS)
def test_a_seed_is_a_plant_and_another_seed_another(fleet):
    assert plant(fleet, 5) == plant(fleet, 5)
    assert plant(fleet, 5).parameters != plant(fleet, 6).parameters


def test_every_run_on_a_plant_meets_the_same_randomness():
    first, second = (plant("rig", 2).sources() for _ in range(2))
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.random(5), other.random(5))


def test_fleets_do_not_share_their_randomness():
    draws = {name: plant(name, 1).sources()[0].random() for name in FLEETS}
    assert len(set(draws.values())) == len(FLEETS)


@pytest.mark.parametrize("seed", range(20))
def test_a_tank_of_any_size_can_be_held_and_is_given_time(seed):
    where = plant("sizes", seed)
    tank = where.parameters
    assert 0.5 <= tank.vessel.volume_l <= 200.0
    assert 50.0 <= tank.element.rated_w <= 5000.0
    assert tank.element.rated_w <= 1000.0 * tank.vessel.volume_l
    bare_s = 12.5 * 4181.0 * tank.vessel.water_kg / tank.element.rated_w
    assert 1200.0 * where.pace > 1.5 * bare_s


def test_a_fleet_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(FleetError, match="rig, sizes, lags, tclab, got 'navy'"):
        plant("navy", 0)


# -- runs ------------------------------------------------------------------------------------------


def test_a_run_is_the_same_whenever_it_is_made():
    one, other = (play(thermostat(None), plant("rig", 1), BRIEF) for _ in range(2))
    assert np.array_equal(one.true_c, other.true_c)
    assert np.array_equal(one.power, other.power)


def test_mains_and_ice_are_the_same_whoever_controls():
    where = plant("rig", 4)
    heated = play(replace(PLAN, controller=Manual(0.5)), where, BRIEF)
    later = play(replace(PLAN, controller=OnOff(20.0)), where, BRIEF)
    assert heated.true_c[0] == later.true_c[0]
    for each in (heated, later):
        assert len(each.t_s) == 21
    # Half the power, the same mains: half the rise above the loss that both have.
    idle = play(replace(PLAN, controller=Manual(0.0)), where, BRIEF)
    full = play(replace(PLAN, controller=Manual(1.0)), where, BRIEF)
    half_k = heated.true_c - idle.true_c
    assert half_k == pytest.approx(0.5 * (full.true_c - idle.true_c), abs=2e-3)


def test_what_happens_does_so_at_the_beginning_of_the_judged_stretch():
    trace = play(thermostat(None), plant("rig", 0), replace(SCENARIOS["step"], judged_s=10.0))
    assert trace.setpoint_c == pytest.approx(np.full(11, 40.0))
    assert trace.t_s[0] == 0.0
    poured = play(thermostat(None), plant("rig", 0), replace(SCENARIOS["cold-water"], judged_s=5.0))
    assert 34.0 < poured.true_c[0] < 35.0


def test_the_stirrer_stands_before_it_is_back():
    scenario = replace(SCENARIOS["stirrer-back"], judged_s=150.0)
    trace = play(PLAN, plant("rig", 0), scenario)
    assert scenario.before_s == 900.0
    assert trace.true_c[0] < 37.4  # the still zone is cold, and the sensor does not see it
    assert trace.true_c[-1] > 37.4


def test_what_happens_long_before_does_not_cut_the_time_to_settle():
    early = Scenario("early", 5.0, (Happening(-1300.0, SETPOINT, 2.5),))
    assert play(PLAN, plant("rig", 0), early).true_c == pytest.approx(np.full(6, 40.0), abs=0.1)


def test_a_law_that_fails_is_told_of():
    class Broken(OnOff):
        def decide(self, belief, situation):
            raise RuntimeError("no idea")

    trace = play(replace(PLAN, controller=Broken()), plant("rig", 0), BRIEF)
    assert "no idea" in trace.failure
    assert trace.power.max() == 0.0


def test_a_latched_regulator_is_told_of():
    hot = replace(PLAN, limits=replace(PLAN.limits, trip_above_c=45.0, setpoint_max_c=45.0),
                  controller=Manual(1.0))  # fmt: skip
    trace = play(hot, plant("rig", 0), replace(BRIEF, judged_s=700.0))
    assert "trip" in trace.failure
    assert trace.power[-1] == 0.0


# -- baselines -------------------------------------------------------------------------------------


def test_simc_gains_are_those_of_the_rules():
    gains = simc(TankParameters())
    slope, dead_s = 1500.0 / (7.96 * 4181.0), 2.0 + 0.5 + 6.0 + 13.5 / 2.0
    assert gains.Kp == pytest.approx(1.0 / (slope * 2.0 * dead_s))
    assert gains.Ki == pytest.approx(gains.Kp / (8.0 * dead_s))
    assert gains.Kd == 0.0
    quick = simc(TankParameters(), derivative=True)
    assert quick.Kp > 2.0 * gains.Kp
    assert quick.Kd > 0.0


def test_simple_pid_brings_the_rig_to_its_set_point():
    pytest.importorskip("simple_pid")
    trace = play(replace(PLAN, controller=SimplePid()), plant("rig", 0), SCENARIOS["warm-up"])
    assert trace.failure is None
    assert trace.true_c[-1] == pytest.approx(37.5, abs=0.1)


def test_a_negative_gain_is_refused():
    with pytest.raises(ValueError, match="Ki must be at least 0, got -1"):
        SimplePid(Ki=-1.0)


# -- nothing twice ---------------------------------------------------------------------------------


def test_what_is_stored_is_not_run_again(tmp_path):
    counting = Counting()
    planned = jobs(Contender("on-off", "one", counting))
    first = [result for _, result in finished(planned, Store(tmp_path / "r.jsonl"), 1)]
    again = [result for _, result in finished(planned, Store(tmp_path / "r.jsonl"), 1)]
    assert counting.seeds == [0, 1, 2]
    assert again == first


def test_another_configuration_is_another_run(tmp_path):
    counting, store = Counting(), Store(tmp_path / "r.jsonl")
    for identity in ("one", "other"):
        list(finished(jobs(Contender("on-off", identity, counting), range(1)), store, 1))
    assert counting.seeds == [0, 0]
    longer = replace(BRIEF, judged_s=21.0)
    list(finished([Job.of(Contender("on-off", "one", counting), plant("rig", 0), longer, 1.0)],
                  store, 1))  # fmt: skip
    assert counting.seeds == [0, 0, 0]


def test_who_stops_early_keeps_what_is_finished(tmp_path):
    counting, path = Counting(), tmp_path / "r.jsonl"
    planned = jobs(Contender("on-off", "one", counting))
    running = finished(planned, Store(path), 1)
    next(running)
    running.close()
    assert len(Store(path)) == 1
    list(finished(planned, Store(path), 1))
    assert counting.seeds == [0, 1, 2]


def test_a_line_that_was_torn_is_run_again_and_the_next_is_whole(tmp_path):
    path, counting = tmp_path / "r.jsonl", Counting()
    planned = jobs(Contender("on-off", "one", counting), range(2))
    list(finished(planned, Store(path), 1))
    path.write_text(path.read_text()[:-40])
    store = Store(path)
    assert (len(store), store.passed_over) == (1, 1)
    list(finished(planned, store, 1))
    assert counting.seeds == [0, 1, 1]
    assert len(Store(path)) == 2


def test_lines_that_are_no_results_are_passed_over(tmp_path):
    path = tmp_path / "r.jsonl"
    good = {"key": "k", "controller": "c", "fleet": "rig", "scenario": "step", "seed": 1,
            "measures": {"settled_s": 1.0}, "failure": None}  # fmt: skip
    bad = [
        {**good, "seed": "1"},
        {**good, "measures": {"settled_s": "soon"}},
        {**good, "measures": {"settled_s": float("nan")}},
        {"key": "k"},
        3,
    ]
    path.write_text("\n".join(json.dumps(each) for each in [good, *bad]) + "\n")
    store = Store(path)
    assert (len(store), store.passed_over) == (1, len(bad))


def test_a_result_that_cannot_be_kept_is_an_error_that_names_the_file(tmp_path):
    store = Store(tmp_path / "r.jsonl")
    (tmp_path / "r.jsonl").mkdir()
    with pytest.raises(StoreError, match=r"r\.jsonl"):
        store.add(Result("k", "c", "rig", "step", 0))


def test_bounds_come_once_for_all_controllers():
    two = [Contender("a", "a", thermostat), Contender("b", "b", thermostat)]
    planned = jobs_for(two, ["lags"], range(2))
    assert len(planned) == 2 * len(FLEETS["lags"].scenarios) * (2 + 1)
    assert sum(job.contender is None for job in planned) == 4
    assert len({job.key for job in planned}) == len(planned)
    assert [job.plant.seed for job in planned] == sorted(job.plant.seed for job in planned)


def test_processes_find_what_one_process_finds(tmp_path):
    planned = jobs(Contender("on-off", "one", thermostat), range(2))
    planned += [Job.of(None, plant("rig", 0), SCENARIOS["step"], 1.0)]
    alone = {job.key: result for job, result in finished(planned, Store(tmp_path / "1"), 1)}
    store = Store(tmp_path / "2")
    together = {job.key: result for job, result in finished(planned, store, 2)}
    assert together == alone
    assert {result.controller for result in alone.values()} == {"on-off", BOUND}
    assert len(Store(tmp_path / "2")) == len(planned)
