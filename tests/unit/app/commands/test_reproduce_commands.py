"""``thermoctl reproduce``: one mechanism for every paper, from the first batch to Ctrl-C."""

import builtins
import errno
import json
import os
from dataclasses import dataclass

import pytest

from thermoctl.app.cli import main
from thermoctl.app.commands import reproduce as reproduce_commands
from thermoctl.app.commands.reproduce import PAPERS, Paper
from thermoctl.studies import figure as house
from thermoctl.studies.papers import ozbek2021
from thermoctl.studies.papers.study import Column, Outcome, generator


@dataclass(frozen=True)
class Counted:
    """A study of next to no work, in batches of ten."""

    title = "Counting"
    columns = (Column("count", "count", "d"),)
    replications: int = 30
    seed: int = 1
    stopped_at = None

    def run(self):
        for finished in range(10, self.replications + 1, 10):
            if self.stopped_at is not None and finished > self.stopped_at:
                raise KeyboardInterrupt
            yield Outcome(finished, [{"count": finished}], {"1": {"title": "a", "values": [1.0]}})

    def draw(self, outcome, files):
        for file in files:
            file.write_text(f"{outcome.replications} of {self.title}")
        return list(files)


class Control(Counted):
    """Another study of the same paper."""

    title = "Controlling"

    def __init__(self, replications=40, seed=1):
        super().__init__(replications, seed)


class Interrupted(Counted):
    """Ctrl-C comes in the third batch."""

    stopped_at = 20


class InterruptedAtOnce(Counted):
    """Ctrl-C comes in the first batch."""

    stopped_at = 0


class Undrawn(Counted):
    """The disk is full when the page is drawn."""

    def draw(self, outcome, files):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(files[0]))


class Forbidden(Counted):
    """Nothing may be computed."""

    def run(self):
        raise AssertionError("computed although it cannot be drawn")
        yield


def paper(kind, **others):
    return Paper(f"{__name__}:{kind.__name__}", "Count.", others)


@pytest.fixture(autouse=True)
def papers(monkeypatch, tmp_path):
    """The papers of these tests beside the real ones, in an empty folder."""
    made = {
        "counted": paper(Counted, **{"--control": paper(Control), "--more": paper(Control)}),
        "interrupted": paper(Interrupted),
        "atonce": paper(InterruptedAtOnce),
        "undrawn": paper(Undrawn),
        "forbidden": paper(Forbidden),
    }
    monkeypatch.setattr(reproduce_commands, "PAPERS", {**PAPERS, **made})
    monkeypatch.setitem(house._STYLE, "savefig.dpi", 30.0)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def reproduce(capsys):
    """Run the command; return its exit code, stdout and stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["reproduce", *map(str, arguments)])
        return ended.value.code, *capsys.readouterr()

    return run


def test_a_study_prints_its_table_and_draws_into_a_folder_of_its_name(reproduce, tmp_path):
    code, out, err = reproduce("counted")
    assert code == 0
    assert [line.rstrip() for line in out.splitlines()] == [
        "Counting",
        "30 runs, seed 1",
        "",
        "count",
        "30",
    ]
    assert err.splitlines() == [
        "thermoctl: folder counted made",
        "thermoctl: figure written to counted/counted.png",
        "thermoctl: figure written to counted/counted.svg",
    ]
    assert (tmp_path / "counted" / "counted.svg").read_text() == "30 of Counting"


def test_json_is_one_object_and_the_messages_stand_beside_it(reproduce):
    code, out, err = reproduce("counted", "--json", "--out", "there", "--seed", 4)
    assert code == 0
    assert json.loads(out) == {
        "table": [{"count": 30}],
        "figures": {"1": {"title": "a", "values": [1.0]}},
        "replications": 30,
        "seed": 4,
        "files": {"png": "there/counted.png", "svg": "there/counted.svg"},
    }
    assert err.count("figure written to there/") == 2


def test_the_count_that_is_asked_for_is_run(reproduce):
    _, out, _ = reproduce("counted", "--replications", 20)
    assert "20 runs, seed 1" in out


def test_an_option_of_the_paper_chooses_another_study_and_other_files(reproduce, tmp_path):
    code, out, _ = reproduce("counted", "--control")
    assert (code, out.splitlines()[0]) == (0, "Controlling")
    assert (tmp_path / "counted" / "counted-control.png").exists()
    assert not (tmp_path / "counted" / "counted.png").exists()


def test_two_studies_at_once_are_refused(reproduce):
    code, _, err = reproduce("counted", "--control", "--more")
    assert code == 2
    assert "expected at most one of --control, --more" in err


@pytest.mark.parametrize("count", ["0", "-3", "1.5", "many", "1000000000"])
@pytest.mark.parametrize("name", list(PAPERS))
def test_a_count_that_makes_no_sense_is_refused_by_name(reproduce, tmp_path, name, count):
    code, out, err = reproduce(name, f"--replications={count}")
    assert (code, out) == (2, "")
    assert "--replications" in err
    assert count in err
    assert list(tmp_path.iterdir()) == []


def test_help_names_the_default_count_of_every_study(reproduce):
    for name, each in PAPERS.items():
        code, out, _ = reproduce(name, "--help")
        assert code == 0
        assert f"{each.study().replications:,} if not given" in " ".join(out.split())
    assert "30 if not given, 40 with --control" in " ".join(
        reproduce("counted", "--help")[1].split()
    )


def test_ctrl_c_keeps_what_is_finished(reproduce, tmp_path):
    code, out, err = reproduce("interrupted")
    assert code == 130
    assert "20 runs, seed 1" in out
    assert "thermoctl: interrupted: 20 of 30 runs are finished" in err.splitlines()
    assert (tmp_path / "interrupted" / "interrupted.png").read_text() == "20 of Counting"


def test_ctrl_c_keeps_what_is_finished_in_json_too(reproduce):
    code, out, err = reproduce("interrupted", "--json")
    assert code == 130
    assert json.loads(out)["replications"] == 20
    assert "interrupted: 20 of 30" in err


def test_ctrl_c_before_anything_is_finished_is_a_plain_interruption(reproduce, tmp_path):
    code, out, err = reproduce("atonce")
    assert (code, out) == (130, "")
    assert err.splitlines()[-1] == "thermoctl: interrupted"
    assert list((tmp_path / "atonce").iterdir()) == []


def test_a_page_that_cannot_be_written_costs_no_numbers(reproduce):
    code, out, err = reproduce("undrawn", "--json")
    told = json.loads(out.splitlines()[0])
    assert code == 1
    assert (told["replications"], told["table"], told["files"]) == (30, [{"count": 30}], {})
    assert "undrawn.png: expected a place for a figure, got: No space left on device" in err


def test_a_folder_that_cannot_be_made_is_told_before_anything_is_computed(reproduce, tmp_path):
    (tmp_path / "taken").write_text("a file")
    for place in ("taken", "taken/below"):
        code, out, err = reproduce("forbidden", "--out", place)
        assert (code, out) == (1, "")
        assert f"thermoctl: {place}: expected a folder for figures, got: " in err


def test_a_folder_that_is_not_ours_is_told_before_anything_is_computed(
    reproduce, tmp_path, monkeypatch
):
    monkeypatch.setattr("os.access", lambda path, mode: False)
    code, _, err = reproduce("forbidden", "--out", tmp_path)
    assert (code, err) == (77, f"thermoctl: {tmp_path}: Permission denied\n")


def test_a_missing_matplotlib_is_told_before_anything_is_computed(reproduce, monkeypatch):
    real = builtins.__import__

    def without_matplotlib(name, *rest, **named):
        if name.partition(".")[0] == "matplotlib":
            raise ImportError(name)
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without_matplotlib)
    code, _, err = reproduce("forbidden")
    assert code == 69
    assert "pip install thermoctl[plot]" in err


def test_a_terminal_sees_how_far_it_is_on_stderr_alone(reproduce, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    _, out, err = reproduce("counted", "--json")
    assert "replicating" in err
    assert json.loads(out)["replications"] == 30


# -- the studies themselves ------------------------------------------------------------------------


@pytest.mark.slow
def test_the_study_of_o21_ends_in_table_page_and_json(reproduce, tmp_path):
    code, out, _ = reproduce("ozbek2021", "--replications", 5, "--json")
    told = json.loads(out)
    assert code == 0
    assert len(told["table"]) == 7
    assert list(told["figures"]) == [str(number) for number in range(1, 19)]
    for file in told["files"].values():
        assert (tmp_path / file).stat().st_size > 10_000


def test_ctrl_c_within_a_batch_of_o21_costs_that_batch_alone(reproduce, monkeypatch):
    def interrupted(seed, replication):
        if replication == 300:
            raise KeyboardInterrupt
        return generator(seed, replication)

    monkeypatch.setattr(ozbek2021, "generator", interrupted)
    monkeypatch.setattr(house, "save", lambda figure, path: path)
    code, out, err = reproduce("ozbek2021", "--json")
    kept = json.loads(out)
    assert code == 130
    assert "interrupted: 250 of 1,000 runs are finished" in err
    monkeypatch.undo()
    *_, whole = ozbek2021.Ozbek2021(250).run()
    assert (kept["replications"], kept["table"]) == (250, whole.table)


def test_a_short_experiment_still_ends_in_json_with_its_figures(reproduce, tmp_path):
    code, out, err = reproduce("experiment", "--duration", "60s", "--json", "--out", "e")
    assert code == 0
    assert json.loads(out)["figures"] == {"png": "e/experiment.png", "svg": "e/experiment.svg"}
    assert err.splitlines()[0] == "thermoctl: folder e made"
    assert (tmp_path / "e" / "experiment.png").exists()
