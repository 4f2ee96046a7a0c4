import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from thermoctl.studies.papers.ozbek2021 import Ozbek2021
from thermoctl.studies.papers.present import outcome_json, print_outcome, shown
from thermoctl.studies.papers.study import Column, Outcome


class Made:
    """A study with every kind of cell, which nobody runs."""

    title = "A study – of σ"
    columns = (Column("case", "case"), Column("error", "mean\nerror", ".2f"), Column("right", "ok"))
    replications, seed = 5000, 3


ROWS = [
    {"case": "one", "error": -1.234, "right": 0.5},
    {"case": "another", "error": None, "right": True},
]
OUTCOME = Outcome(1200, ROWS, {"1": {"title": "Figure", "values": [1.0, 2.0]}})


class Ascii(io.StringIO):
    encoding = "ascii"


def printed(outcome=OUTCOME, study=Made, file=io.StringIO, width=100):
    console = Console(file=file(), width=width)
    print_outcome(console, study, outcome)
    return console.file.getvalue()


@pytest.mark.parametrize(
    ("cell", "form", "text"),
    [
        (-0.5, ".2f", "−0.50"),
        (1e-9, ".3g", "1e−09"),
        (23, "d", "23"),
        (None, ".3g", "–"),
        (True, ".3g", "yes"),
        (False, ".3g", "no"),
        ("AR(2) - d 1", ".3g", "AR(2) - d 1"),
    ],
)
def test_a_cell_is_shown_as_a_reader_wants_it(cell, form, text):
    assert shown(cell, Column("key", "heading", form)) == text


def test_the_runs_that_are_finished_are_said_and_not_those_asked_for():
    assert printed().splitlines()[:2] == ["A study – of σ", "1,200 runs, seed 3"]
    assert "1 run, seed 3" in printed(replace(OUTCOME, replications=1))


def test_words_begin_and_numbers_end_together():
    columns = (*Made.columns, Column("word", "in words"))
    study = type("Worded", (Made,), {"columns": columns})
    rows = [{**row, "word": word} for row, word in zip(ROWS, ("long word", "word"), strict=True)]
    above, below = printed(replace(OUTCOME, table=rows), study).splitlines()[-2:]
    assert above.index("long word") == below.index("word")
    assert above.index("0.5") + len("0.5") == below.index("yes") + len("yes")


def test_every_row_is_printed_under_the_headings():
    rows = [line.split() for line in printed().splitlines()[-2:]]
    assert rows == [["one", "−1.23", "0.5"], ["another", "–", "yes"]]


@pytest.mark.parametrize("width", [20, 60, 200])
def test_a_narrow_terminal_loses_nothing(width):
    outcome = next(Ozbek2021(1).run())
    text = printed(outcome, Ozbek2021(1), width=width)
    assert "…" not in text
    for row in outcome.table:
        assert row["method"] in text
        assert f"{row['residual_variance']:.3f}" in text


def test_an_ascii_console_gets_ascii():
    assert printed(file=Ascii).isascii()


def test_json_has_table_and_figures_and_what_they_were_made_of():
    told = outcome_json(Made, OUTCOME, [Path("x/o.png"), Path("x/o.svg")])
    assert list(told) == ["table", "figures", "replications", "seed", "files"]
    assert told["table"] == ROWS
    assert told["figures"]["1"]["values"] == [1.0, 2.0]
    assert (told["replications"], told["seed"]) == (1200, 3)
    assert told["files"] == {"png": "x/o.png", "svg": "x/o.svg"}
    json.dumps(told, allow_nan=False)
