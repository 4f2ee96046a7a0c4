"""Kinds found by entry point, and laws built from options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pytest

from thermoctl.app import plugins
from thermoctl.app.plugins import BadOption, build, find, kinds, nearest, option_names
from thermoctl.errors import ConfigError


@dataclass(frozen=True)
class Law:
    structure: object
    reach_s: float
    steps: int = 3
    loud: bool = False
    taps: tuple[float, ...] = (1.0,)

    name: ClassVar[str] = "law"

    def __post_init__(self) -> None:
        if not self.reach_s > 0.0:
            raise ValueError(f"reach_s must be positive, got {self.reach_s!r}")
        if self.steps > 9:
            raise ValueError("too many steps")


def test_a_driver_of_another_package_is_found_by_its_entry_point(foreign):
    assert find(plugins.DRIVERS, "foreign") is foreign.Foreign


def test_a_driver_that_cannot_be_imported_is_a_bad_configuration(foreign):
    with pytest.raises(ConfigError, match=r"driver 'broken' cannot be loaded.*not_there_at_all"):
        find(plugins.DRIVERS, "broken")


@pytest.mark.parametrize("group", [plugins.DRIVERS, plugins.CONTROLLERS, plugins.ESTIMATORS])
def test_every_kind_that_is_declared_can_be_loaded(group):
    assert all(find(group, kind) for kind in kinds(group))


def test_an_unknown_kind_is_told_the_nearest_one():
    with pytest.raises(BadOption, match="no controller is called 'on-of'; did you mean 'on-off'"):
        find(plugins.CONTROLLERS, "on-of")


def test_what_resembles_nothing_is_told_all_there_is():
    assert nearest("zzz", ["b", "a"]) == "; known: a, b"
    assert nearest("zzz", []) == ""


def test_what_the_composer_fills_in_is_no_option():
    assert option_names(Law, ("structure",)) == ("reach_s", "steps", "loud", "taps")
    with pytest.raises(BadOption, match="structure: unknown key"):
        build(Law, {"structure": 1, "reach_s": 1.0}, structure=2)


def test_a_list_is_taken_for_a_tuple_and_a_whole_number_for_a_float():
    assert build(Law, {"reach_s": 2, "taps": [1, 2.5]}, structure=0) == Law(0, 2.0, taps=(1, 2.5))


@pytest.mark.parametrize(
    ("options", "path", "text"),
    [
        ({}, ("reach_s",), "expected a value, got none"),
        ({"reach_s": "1.0"}, ("reach_s",), "expected a valid number, got '1.0'"),
        ({"reach_s": True}, ("reach_s",), "expected a valid number, got True"),
        ({"reach_s": 1.0, "steps": 2.0}, ("steps",), "expected a valid integer, got 2.0"),
        ({"reach_s": 1.0, "loud": 1}, ("loud",), "expected a valid boolean, got 1"),
        ({"reach_s": 1.0, "taps": ["x"]}, ("taps",), "expected a valid number, got ['x']"),
        ({"reach": 1.0}, ("reach",), "unknown key; did you mean 'reach_s'?"),
        ({"reach_s": -1.0}, ("reach_s",), "expected a number above 0, got -1.0"),
        ({"reach_s": 1.0, "steps": 10}, (), "too many steps"),
    ],
)
def test_a_bad_option_is_named_with_what_was_expected(options, path, text):
    with pytest.raises(BadOption) as caught:
        build(Law, options, structure=0)
    assert (caught.value.path, caught.value.text) == (path, text)
