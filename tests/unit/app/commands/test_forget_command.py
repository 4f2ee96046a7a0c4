"""``thermoctl forget``, and what it refuses."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from thermoctl.app.commands.forget import forget
from thermoctl.errors import ConfigError, Unavailable
from thermoctl.services.learned import LearnedStore
from thermoctl.services.lock import DaemonLock

AQUARIUM = Path(__file__).parents[4] / "config" / "aquarium.toml"


@pytest.fixture
def store(tmp_path):
    store = LearnedStore(tmp_path)
    store.save("tank", {"adaptive": {"gain_k_per_s": 0.04}})
    return store


def call(store, loop="tank"):
    arguments = [loop, "-c", str(AQUARIUM), "--state", str(store.path_of("x").parent)]
    return CliRunner().invoke(forget, arguments, standalone_mode=False)


def test_what_was_learnt_is_gone_and_the_file_named(store):
    told = call(store)
    assert "tank: forgotten" in told.output
    assert str(store.path_of("tank")) in told.output
    assert store.load("tank") == ({}, None)


def test_forgetting_twice_says_that_there_was_nothing(store):
    call(store)
    assert "no model in" in call(store).output


def test_while_a_daemon_runs_it_is_refused_and_nothing_is_lost(store):
    with DaemonLock(store.path_of("tank").parent / "daemon.lock"):
        told = call(store)
    assert isinstance(told.exception, Unavailable)
    assert "a daemon is running" in str(told.exception)
    assert "stop it first" in str(told.exception)
    assert set(store.load("tank")[0]) == {"adaptive"}


def test_an_unknown_loop_is_refused_by_name(store):
    told = call(store, "tnak")
    assert isinstance(told.exception, ConfigError)
    assert "tnak" in str(told.exception)
