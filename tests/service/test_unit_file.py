"""The systemd unit, as systemd's own tools read it. No service manager is started."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SYSTEMD = Path(__file__).parents[2] / "systemd"
UNIT = (SYSTEMD / "thermoctl.service").read_text(encoding="utf-8")

pytestmark = [
    pytest.mark.service,
    pytest.mark.skipif(
        shutil.which("systemd-analyze") is None,
        reason="systemd-analyze is not installed, so nobody can say what the unit means",
    ),
]


def analyze(folder: Path, unit: str, *command: str) -> subprocess.CompletedProcess[str]:
    """Run systemd-analyze on `unit`, with a program that exists here in place of the installed."""
    path = folder / "thermoctl.service"
    program = f"ExecStart={sys.executable} -c pass"
    path.write_text(re.sub(r"^ExecStart=.*$", program, unit, flags=re.MULTILINE))
    return subprocess.run(
        ["systemd-analyze", *command, str(path)], capture_output=True, text=True, check=False
    )


def test_the_unit_is_understood_without_a_word(tmp_path):
    verified = analyze(tmp_path, UNIT, "verify")
    assert (verified.returncode, verified.stdout, verified.stderr) == (0, "", "")


@pytest.mark.parametrize(
    "wrong",
    ["WatchdogSec=soon", "Restart=perhaps", "ProtectSytem=strict", "DeviceAllow=ttyUSB0 rw"],
)
def test_a_wrong_line_would_be_noticed(tmp_path, wrong):
    unit = UNIT.replace("Type=notify\n", f"Type=notify\n{wrong}\n")
    # systemd-analyze exits 0 on these, which is why the test above asks for silence
    assert analyze(tmp_path, unit, "verify").stderr


def test_the_lines_for_real_time_are_understood_too(tmp_path):
    unit, count = re.subn(r"^#(?=CPUScheduling|RestrictRealtime)", "", UNIT, flags=re.MULTILINE)
    assert count == 3
    assert analyze(tmp_path, unit, "verify").stderr == ""


def test_the_service_is_exposed_to_little(tmp_path):
    judged = analyze(tmp_path, UNIT, "security", "--offline=yes", "--no-pager")
    found = re.search(r"Overall exposure level for thermoctl.service: ([\d.]+)", judged.stdout)
    assert found is not None, judged.stderr
    assert float(found[1]) <= 1.0
