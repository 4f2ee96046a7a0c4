"""Configurations to begin with, and a package that brings a driver of its own."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

FOREIGN_DRIVER = '''
"""A driver that another package brings."""

import threading
from typing import ClassVar, Literal

from pydantic import BaseModel

from thermoctl.errors import LinkError
from thermoctl.ports import Capabilities, Health, Identity
from thermoctl.signals import RawSample

released = threading.Event()
written = []


class Settings(BaseModel):
    model_config = {"frozen": True, "extra": "forbid"}
    kind: Literal["foreign"] = "foreign"
    behaviour: Literal["well", "lost", "hangs", "breaks", "mute", "open", "willful"] = "well"
    gain: float = 1.0
    colours: tuple[str, ...] = ("red",)


class Foreign:
    """A board from elsewhere."""

    Settings: ClassVar = Settings
    transport: ClassVar[str] = "none"
    capabilities = Capabilities(dead_man=False)

    def __init__(self, settings, link, clock):
        self._behaviour, self._clock = settings.behaviour, clock

    def open(self, deadline_s):
        if self._behaviour == "lost":
            raise LinkError("expected a board, got silence")
        if self._behaviour == "breaks":
            raise RuntimeError("a bug")
        if self._behaviour == "hangs":
            released.wait()
        return Identity("foreign", "somewhere", "7")

    def read(self, deadline_s):
        if self._behaviour == "mute":
            return {}
        counts = 4095 if self._behaviour == "open" else 2500
        return {"temperature": RawSample(self._clock.now_s(), counts, 4096.0)}

    def write(self, outputs, valid_for_s, deadline_s):
        written.append(dict(outputs))
        return {name: 0.5 if self._behaviour == "willful" else 0.0 for name in outputs}

    def health(self):
        return Health("ok")

    def close(self):
        written.append("closed")
'''


@pytest.fixture
def foreign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Install a package whose entry points are a driver ``foreign`` and one that is broken."""
    site = tmp_path / "site"
    described = site / "thermoctl_foreign-1.2.dist-info"
    described.mkdir(parents=True)
    (described / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: thermoctl-foreign\nVersion: 1.2\n"
    )
    (described / "entry_points.txt").write_text(
        "[thermoctl.drivers]\nforeign = thermoctl_foreign:Foreign\nbroken = not_there_at_all:X\n"
    )
    (site / "thermoctl_foreign.py").write_text(FOREIGN_DRIVER)
    monkeypatch.syspath_prepend(str(site))
    module = importlib.import_module("thermoctl_foreign")
    yield module
    module.released.set()
    sys.modules.pop("thermoctl_foreign", None)


@pytest.fixture
def minimal() -> dict:
    """Return the least that is a configuration."""
    return {"loops": {"tank": {"setpoint_c": 37.5, "trip_above_c": 60}}}


@pytest.fixture
def whole() -> str:
    """Return a configuration that can run, as TOML."""
    return """\
[boards.daq]
kind = "simulated"
volume_l = 8.0

[loops.tank]
setpoint_c = 37.5
trip_above_c = 60.0
setpoint_max_c = 55.0
[loops.tank.sensor]
board = "daq"

[loops.tank.actuator]
board = "daq"
law = "square"

[loops.tank.controller]
kind = "self-tuning-mv"
reference_time_s = 60.0

[loops.tank.estimator]
kind = "ckf"
R2 = 0.01
"""
