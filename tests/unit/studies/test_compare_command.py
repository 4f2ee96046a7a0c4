"""``thermoctl compare`` as it is typed."""

import json
import re

import pytest
from click.testing import CliRunner

from thermoctl.app.cli import main
from thermoctl.app.commands.compare import RESULTS, compare, contender
from thermoctl.app.plugins import BadOption
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.control.minimum_variance import SelfTuningMinimumVariance
from thermoctl.errors import ConfigError, Unavailable
from thermoctl.studies.compare import baselines
from thermoctl.studies.compare.plants import plant

_, TABLE = load(profile("aquarium")).loop()
BRIEF = ["--scenario", "warm-up", "--seeds", "1", "--jobs", "1"]


def run(*arguments):
    return CliRunner().invoke(compare, [str(each) for each in arguments])


def test_options_behind_the_colon_are_those_of_the_law():
    plan = contender("self-tuning-mv:reference_time_s=45,zero_radius=2.0", TABLE)
    law = plan.plan_for(plant("rig", 0)).controller
    assert isinstance(law, SelfTuningMinimumVariance)
    assert (law.reference_time_s, law.zero_radius) == (45, 2.0)


def test_a_kind_alone_has_the_defaults_of_its_law_not_those_of_the_profile():
    law = contender("self-tuning-mv", TABLE).plan_for(plant("rig", 0)).controller
    assert law.reference_time_s == 0.0


def test_contenders_that_differ_in_an_option_have_another_identity():
    identities = {contender(text, TABLE).identity for text in ("on-off", "on-off:hysteresis_k=1")}
    identities.add(contender("on-off", TABLE, nameplate=True).identity)
    assert len(identities) == 3
    assert contender("on-off", TABLE).identity in identities


def test_a_nameplate_tells_the_model_litres_and_watts():
    small = plant("sizes", 1)
    told = contender("self-tuning-mv", TABLE, nameplate=True).plan_for(small).identifier
    tank = small.parameters
    expected_k = tank.element.rated_w / (4186.0 * tank.vessel.volume_l)
    assert told.structure.b_k == pytest.approx(expected_k)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("bang", "no controller is called 'bang'; known: .*on-off.*simple-pid"),
        ("simple_pid", "no controller is called 'simple_pid'; did you mean 'simple-pid'"),
        ("on-off:hysteresis=1", "hysteresis"),
        ("on-off:hysteresis_k", "expected kind:option=value"),
        ("on-off:hysteresis_k=-1", "at least 0, got -1"),
        ("simple-pid:Kq=1", "Kq: unknown key"),
    ],
)
def test_a_bad_controller_is_refused_with_what_was_expected(text, words):
    if text.startswith("simple-pid"):
        pytest.importorskip("simple_pid")
    with pytest.raises(BadOption, match=words):
        contender(text, TABLE)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fleet", "navy"], "expected one of rig, sizes, lags, tclab, got 'navy'"),
        (["--scenario", "flood"], "expected one of warm-up, .*second-heater, got 'flood'"),
        (["--quick", "--seeds", "3"], "--quick or --seeds"),
        (["--fleet", "sizes", "--scenario", "ice"], "expected a scenario of sizes"),
    ],
)
def test_bad_names_are_refused_with_the_list_of_what_there_is(arguments, words, tmp_path):
    done = run(*arguments, "--controller", "on-off", "--out", tmp_path)
    assert done.exit_code == 2
    assert re.search(words, " ".join(done.output.split()))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["foo", "on-off:hysteresis=1", "on-off:hysteresis_k=-1"])
def test_a_controller_typed_wrongly_is_wrong_usage(text, tmp_path):
    done = run(*BRIEF, "--controller", "on-off", "--controller", text, "--out", tmp_path)
    assert done.exit_code == 2
    assert "--controller" in done.output


def test_a_controller_that_there_is_not_is_told_with_those_there_are(tmp_path):
    said = run(*BRIEF, "--controller", "foo", "--out", tmp_path).output
    assert re.search("no controller is called 'foo'; known: .*adaptive.*on-off", said, re.DOTALL)


def test_a_loop_that_may_not_be_so_warm_is_refused(tmp_path):
    text = profile("aquarium").read_text(encoding="utf-8")
    cold = tmp_path / "cold.toml"
    cold.write_text(text.replace("setpoint_max_c = 55.0", "setpoint_max_c = 38.0"))
    done = run("--controller", "on-off", "-c", cold, "--out", tmp_path / "out")
    assert isinstance(done.exception, ConfigError)
    assert "cannot be compared" in str(done.exception)


def test_a_baseline_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(baselines._MODULES, "simple-pid", "no_such_package")
    with pytest.raises(Unavailable, match="simple-pid is not installed"):
        contender("simple-pid", TABLE)


def test_a_comparison_prints_a_table_draws_a_page_and_keeps_its_runs(tmp_path):
    done = run("--controller", "on-off", *BRIEF, "--out", tmp_path)
    assert done.exit_code == 0, done.output
    assert "settled after" in done.output
    assert "the verdict is on on-off" in done.output
    names = {file.name for file in tmp_path.iterdir()}
    assert names >= {RESULTS, "compare.png", "compare.svg"}
    assert len((tmp_path / RESULTS).read_text().splitlines()) == 2


@pytest.fixture
def ended(capsys, monkeypatch):
    """Return a function that runs the program, and returns exit code, stdout and stderr."""
    monkeypatch.setenv("COLUMNS", "200")

    def ended(*arguments):
        with pytest.raises(SystemExit) as end:
            main(["compare", *map(str, arguments)])
        return (end.value.code, *capsys.readouterr())

    return ended


@pytest.mark.slow
def test_a_check_ends_with_1_when_the_first_controller_misses_a_goal(tmp_path, ended):
    arguments = ["--controller", "on-off", *BRIEF, "--out", tmp_path]
    code, _, said = ended(*arguments, "--check")
    assert code == 1
    assert "on-off misses a goal of rig, warm-up: expected overshoot median 0.08" in said
    assert "expected settled after median 1.2, 95 % 1.4 × at most, got never / never (" in said
    code, printed, _ = ended(*arguments, "--check", "--json")
    assert code == 1
    assert json.loads(printed)["lines"]
    assert ended(*arguments)[0] == 0  # a comparison that could be made


@pytest.mark.slow
def test_a_check_asks_nothing_of_the_others(tmp_path, ended):
    both = ["--controller", "adaptive", "--controller", "on-off", *BRIEF, "--out", tmp_path]
    code, _, said = ended(*both, "--check")
    assert (code, "misses" in said) == (0, False)


@pytest.mark.slow
def test_json_is_one_object_and_the_second_time_nothing_is_run(tmp_path):
    arguments = ["--controller", "on-off", *BRIEF, "--out", tmp_path, "--json"]
    first, second = run(*arguments), run(*arguments)
    content = json.loads(second.stdout)
    assert content == json.loads(first.stdout)
    assert content["conditions"]["seeds"] == 1
    assert [each["measure"] for each in content["lines"]] == ["overshoot_k", "settled_s"]
    assert len((tmp_path / RESULTS).read_text().splitlines()) == 2


@pytest.mark.slow
def test_another_first_seed_is_another_plant(tmp_path):
    arguments = ["--controller", "on-off", *BRIEF, "--out", tmp_path, "--json"]
    usual = json.loads(run(*arguments).stdout)
    fresh = json.loads(run(*arguments, "--first-seed", 300).stdout)
    assert [each["conditions"]["first_seed"] for each in (usual, fresh)] == [0, 300]
    assert usual["lines"] != fresh["lines"]
    rows = [json.loads(row) for row in (tmp_path / RESULTS).read_text().splitlines()]
    assert {row["seed"] for row in rows} == {0, 300}


@pytest.mark.slow
def test_a_run_on_a_lab_is_kept_with_its_bound_and_not_made_twice(tmp_path):
    arguments = ["--controller", "marlin-mpc", "--fleet", "tclab", *BRIEF, "--out", tmp_path]
    first, second = run(*arguments, "--json"), run(*arguments, "--json")
    content = json.loads(second.stdout)
    assert content == json.loads(first.stdout)
    assert {each["fleet"] for each in content["lines"]} == {"tclab"}
    (settled,) = (each for each in content["lines"] if each["measure"] == "settled_s")
    assert 40.0 < settled["bound"] < 120.0
    assert len((tmp_path / RESULTS).read_text().splitlines()) == 2


def test_a_loop_of_ones_own_that_may_not_be_as_warm_as_a_lab_is_refused(tmp_path):
    text = profile("aquarium").read_text(encoding="utf-8")
    tepid = tmp_path / "tepid.toml"
    tepid.write_text(text.replace("setpoint_max_c = 55.0", "setpoint_max_c = 51.0"))
    own = ["--controller", "on-off", "-c", tepid, "--fleet", "tclab", "--out", tmp_path / "out"]
    done = run(*own)
    assert isinstance(done.exception, ConfigError)
    assert "52.5" in str(done.exception)
