"""What controllers have learnt survives on disk, and what cannot be understood is ignored."""

import json

import pytest

from thermoctl.services.learned import EVERY_S, LearnedStore, ModelKeeper, remembered_models
from thermoctl.signals import State

NOW_S = 1_800_000_000.0
MODEL = {"gain_k_per_s": 0.036, "log_weights": [0.0, -2.5]}


class Cycle:
    """A cycle, as far as a keeper looks at it."""

    def __init__(self, models, state=State.RUN):
        self.models, self.state, self.asked = models, state, 0

    @property
    def step(self):
        return self

    def remember(self):
        self.asked += 1
        return self.models


class Clock:
    """A time that is set by hand."""

    def __init__(self, now_s=0.0):
        self.now_s = now_s

    def __call__(self):
        return self.now_s


def store_at(folder, now_s=NOW_S):
    return LearnedStore(folder, lambda: now_s)


def test_a_model_comes_back_as_it_was_with_its_age(tmp_path):
    store_at(tmp_path).save("tank", {"adaptive": MODEL})
    models, warning = store_at(tmp_path, NOW_S + 3600.0).load("tank")
    assert warning is None
    assert dict(models["adaptive"].model) == MODEL
    assert models["adaptive"].age_s == pytest.approx(3600.0)


def test_the_file_says_which_loop_law_and_time_it_is_of(tmp_path):
    store_at(tmp_path).save("tank", {"adaptive": MODEL})
    content = json.loads((tmp_path / "model-tank.json").read_text())["content"]
    assert content["loop"] == "tank"
    assert content["version"] == 1
    assert content["models"]["adaptive"]["learnt_utc"] == "2027-01-15T08:00:00+00:00"


def test_the_model_of_a_law_that_is_not_there_now_stays(tmp_path):
    store_at(tmp_path).save("tank", {"pid": {"gain_per_k": 0.2}})
    store_at(tmp_path).save("tank", {"adaptive": MODEL})
    models, _ = store_at(tmp_path).load("tank")
    assert set(models) == {"pid", "adaptive"}


def test_nothing_was_ever_stored_is_no_warning(tmp_path):
    assert store_at(tmp_path).load("tank") == ({}, None)


def whole(**changed):
    content = {
        "version": 1,
        "loop": "tank",
        "models": {"adaptive": {"learnt_utc_s": NOW_S, "model": MODEL}},
    }
    return {"format": 1, "written_utc_s": NOW_S, "content": content | changed}


BAD = {
    "empty": b"",
    "zeros after a power cut": b"\0" * 512,
    "torn": json.dumps(whole()).encode()[:-30],
    "garbage": bytes(range(256)) * 8,
    "no object": b"[1, 2]",
    "far too long": b" " * 70_000,
    "of another version": json.dumps(whole(version=2)).encode(),
    "of another loop": json.dumps(whole(loop="vat")).encode(),
    "models that are none": json.dumps(whole(models=[MODEL])).encode(),
    "a model that is none": json.dumps(whole(models={"adaptive": 3})).encode(),
    "without a time": json.dumps(whole(models={"adaptive": {"model": MODEL}})).encode(),
    "NaN as a time": json.dumps(
        whole(models={"adaptive": {"learnt_utc_s": float("nan"), "model": MODEL}})
    ).encode(),
    "from the future": json.dumps(whole() | {"written_utc_s": NOW_S + 1e6}).encode(),
}


@pytest.mark.parametrize("content", BAD.values(), ids=BAD)
def test_what_cannot_be_understood_is_ignored_with_a_warning_that_names_the_file(tmp_path, content):
    (tmp_path / "model-tank.json").write_bytes(content)
    told = []
    found = remembered_models(
        store_at(tmp_path), {"tank": None}, lambda name, loop, why: told.append((name, loop, why))
    )
    assert found == {"tank": {}}
    assert [(name, loop) for name, loop, _ in told] == [("state.ignored", "tank")]
    assert "model-tank.json" in told[0][2]


def test_a_file_that_cannot_be_understood_is_replaced_by_the_next_write(tmp_path):
    (tmp_path / "model-tank.json").write_bytes(b"{")
    store_at(tmp_path).save("tank", {"adaptive": MODEL})
    assert set(store_at(tmp_path).load("tank")[0]) == {"adaptive"}


def test_a_whole_file_of_this_loop_is_understood(tmp_path):
    (tmp_path / "model-tank.json").write_text(json.dumps(whole()))
    assert set(store_at(tmp_path).load("tank")[0]) == {"adaptive"}


def test_a_clock_that_was_set_back_a_little_makes_no_negative_age(tmp_path):
    store_at(tmp_path).save("tank", {"adaptive": MODEL})
    models, _ = store_at(tmp_path, NOW_S - 600.0).load("tank")
    assert models["adaptive"].age_s == 0.0


def test_a_loop_is_forgotten_once(tmp_path):
    store = store_at(tmp_path)
    store.save("tank", {"adaptive": MODEL})
    assert store.forget("tank")
    assert not store.forget("tank")
    assert store.load("tank") == ({}, None)


def test_a_running_loop_is_stored_every_ten_minutes_and_at_the_end(tmp_path):
    store, clock, cycle = store_at(tmp_path), Clock(), Cycle({"adaptive": MODEL})
    keeper = ModelKeeper(store, clock)
    for seconds in range(0, int(2.5 * EVERY_S), 10):
        clock.now_s = float(seconds)
        keeper.store({"tank": cycle})
    assert cycle.asked == 2
    keeper.store({"tank": cycle}, at_end=True)
    assert cycle.asked == 3
    assert set(store.load("tank")[0]) == {"adaptive"}


def test_nothing_is_stored_of_a_loop_that_is_safe_or_latched(tmp_path):
    store = store_at(tmp_path)
    keeper = ModelKeeper(store, Clock())
    for state in (State.SAFE, State.LATCHED, State.RIDE, State.HOLD):
        keeper.store({"tank": Cycle({"adaptive": MODEL}, state)}, at_end=True)
    assert store.load("tank") == ({}, None)


def test_what_is_not_known_yet_leaves_what_was_stored(tmp_path):
    store = store_at(tmp_path)
    store.save("tank", {"adaptive": MODEL})
    ModelKeeper(store, Clock()).store({"tank": Cycle({})}, at_end=True)
    assert set(store.load("tank")[0]) == {"adaptive"}


@pytest.mark.parametrize("odd", [float("nan"), object(), {1, 2}], ids=["NaN", "object", "set"])
def test_a_model_that_is_no_json_costs_nothing_but_itself(tmp_path, odd):
    store = store_at(tmp_path)
    store.save("tank", {"adaptive": MODEL})
    keeper = ModelKeeper(store, Clock())
    keeper.store({"tank": Cycle({"odd": {"x": odd}})}, at_end=True)
    assert set(store.load("tank")[0]) == {"adaptive"}


def test_a_folder_that_takes_nothing_costs_nothing(tmp_path):
    (tmp_path / "file").write_text("no folder")
    keeper = ModelKeeper(store_at(tmp_path / "file"), Clock())
    keeper.store({"tank": Cycle({"adaptive": MODEL})}, at_end=True)
    assert (tmp_path / "file").read_text() == "no folder"
