"""The page on the configuration says what the program takes."""

from __future__ import annotations

import re
import runpy
import tomllib
from pathlib import Path

import pytest

from thermoctl.app import plugins
from thermoctl.app.catalogue import (
    first_line,
    option_schemas,
    parameter_texts,
    rows_of_law,
)
from thermoctl.app.compose import wiring_errors
from thermoctl.app.configuration import tables
from thermoctl.app.configuration.bases import Table
from thermoctl.app.configuration.units import unit_of
from thermoctl.app.settings import load
from thermoctl_drivers.simulated import SimulatedSettings

DOCS = Path(__file__).parents[4] / "docs"
SCRIPT = runpy.run_path(str(DOCS / "make_configuration.py"))
PAGE = (DOCS / "configuration.md").read_text(encoding="utf-8")
TABLES = [
    each
    for each in vars(tables).values()
    if isinstance(each, type)
    and issubclass(each, Table | tables.Options)
    and each not in (Table, tables.Options)
]


def test_the_tables_are_those_that_the_script_makes():
    assert SCRIPT["filled"](PAGE) == PAGE, "run python docs/make_configuration.py"


def test_every_table_and_kind_that_ships_has_its_place():
    marked = set(re.findall(r"<!-- table: ([\w -]+) -->", PAGE))
    expected = {each.__name__ for each in TABLES}
    for group, word in (
        (plugins.DRIVERS, "driver"),
        (plugins.CONTROLLERS, "controller"),
        (plugins.ESTIMATORS, "estimator"),
    ):
        for kind, entry in plugins.kinds(group).items():
            if entry.value.startswith("thermoctl"):
                expected.add(f"{word} {kind}")
                law = plugins.find(group, kind)
                if word == "controller" and any("." in row.key for row in rows_of_law(law)):
                    expected.add(f"constants {kind}")
    assert marked == expected


@pytest.mark.parametrize("model", TABLES, ids=lambda model: model.__name__)
def test_every_key_says_what_it_is_for(model):
    for row in SCRIPT["rows"](model.__name__):
        assert f"| `{row.key}` |" in PAGE
        assert row.text, row.key


def test_every_option_of_every_law_is_described_by_its_docstring():
    for group in (plugins.CONTROLLERS, plugins.ESTIMATORS):
        for kind in plugins.kinds(group):
            law = plugins.find(group, kind)
            assert first_line(law)
            assert set(option_schemas(law)) <= set(parameter_texts(law))


def test_the_first_example_can_run():
    example = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert example is not None
    assert list(wiring_errors(load(tomllib.loads(example[1])))) == []


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("setpoint_c", "°C"),
        ("zero_v_c", "°C"),
        ("kelvin_per_v", "K/V"),
        ("gain_k_per_s", "K/s"),
        ("rise_per_s", "1/s"),
        ("mains_hz", "Hz"),
        ("bits", "bit"),
        ("cycles", ""),
        ("n", ""),
        ("R2", ""),
    ],
)
def test_a_key_wears_its_unit(key, unit):
    assert unit_of(key) == unit


def test_a_row_has_bounds_default_and_meaning():
    [row] = [each for each in SCRIPT["rows"]("driver simulated") if each.key == "bits"]
    assert (row.type, row.unit, row.bounds) == ("whole number", "bit", "≥ 8, ≤ 24")
    assert row.default == str(SimulatedSettings().bits)
    assert row.text == "Resolution of the A/D converter, in bits."
