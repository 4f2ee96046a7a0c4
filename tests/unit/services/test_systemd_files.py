"""What the unit and the udev rule promise, read without systemd."""

from __future__ import annotations

import configparser
import re
from pathlib import Path

import pytest

SYSTEMD = Path(__file__).parents[3] / "systemd"
ASSIGNMENT = re.compile(r'[A-Z]+(\{[A-Za-z_]+\})?(==|!=|\+=|:=|=)"[^"]*"')


@pytest.fixture(scope="module")
def unit():
    parser = configparser.RawConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # systemd's keys have capitals
    parser.read(SYSTEMD / "thermoctl.service")
    return {key: value for section in parser.sections() for key, value in parser.items(section)}


def test_errors_that_no_restart_cures_do_not_restart(unit):
    assert unit["Restart"] == "on-failure"
    assert set(unit["RestartPreventExitStatus"].split()) == {"2", "69", "77", "78"}


def test_a_crash_loop_stays_down(unit):
    assert (unit["StartLimitBurst"], unit["StartLimitIntervalSec"]) == ("5", "300")
    assert "SuccessExitStatus" not in unit


def test_a_start_that_fails_at_once_five_times_meets_the_limit(unit):
    pause_s = float(unit["RestartSec"].removesuffix("ms")) / 1000.0
    longest_life_s = float(unit["TimeoutStartSec"]) + pause_s
    assert 5 * longest_life_s < float(unit["StartLimitIntervalSec"])


def test_the_runtime_folder_outlives_a_stop_because_a_latch_may_lie_there(unit):
    assert unit["RuntimeDirectoryPreserve"] == "yes"


def test_the_stop_leaves_time_to_confirm_power_0(unit):
    assert float(unit["TimeoutStopSec"]) >= 2.0


def test_every_rule_of_udev_is_a_list_of_assignments():
    text = (SYSTEMD / "99-thermoctl.rules").read_text(encoding="utf-8")
    rules = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert rules
    for rule in rules:
        assert all(ASSIGNMENT.fullmatch(part) for part in rule.split(", ")), rule
    labels = set(re.findall(r'LABEL="(\w+)"', text))
    assert set(re.findall(r'GOTO="(\w+)"', text)) == labels
