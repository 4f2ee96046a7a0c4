"""The script ``dev`` on machines that lack something; nothing is installed or downloaded here."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
TOOLS = ("cat", "cksum", "date", "dirname", "mkdir", "readlink", "rm", "sh", "sleep", "tail")
UNAVAILABLE = 69

# Stand-ins for what a machine may have; each is asked only what the script asks.
OLD_PYTHON = '[ "$1" = --version ] && echo "Python 3.9.2" && exit; exit 1'
BARE_PYTHON = """case "$*" in
--version) echo "Python 3.11.2" ;;
*"import ensurepip"* | "-m pip"*) exit 1 ;;
"-m venv --without-pip "*) mkdir -p "$4/bin" && cp "$0" "$4/bin/python" ;;
"-m venv"*) exit 1 ;;
esac"""
PIP = 'case "$*" in --version) echo "pip {} from x" ;; *) echo "$*" >>"$PIP_CALLS" ;; esac'

pytestmark = pytest.mark.e2e


@dataclass(frozen=True, slots=True)
class Machine:
    """A working copy, and the folder that holds every command there is."""

    copy: Path
    bin: Path

    def has(self, name: str, script: str) -> None:
        """Add a command."""
        command = self.bin / name
        command.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        command.chmod(0o755)

    def dev(
        self, *arguments: str, script: Path | None = None, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run the script and return how it ended."""
        env: Mapping[str, str] = {"PATH": str(self.bin), "LC_ALL": "C", **environment}
        return subprocess.run(
            [script or self.copy / "dev", *arguments],
            cwd=self.bin,
            env=env,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=60.0,
            check=False,
        )


@pytest.fixture
def machine(tmp_path):
    """A machine with a shell and its usual commands, but without Python."""
    made = Machine(tmp_path / "a working copy", tmp_path / "bin")
    made.copy.mkdir()
    made.bin.mkdir()
    for name in ("dev", "pyproject.toml"):
        shutil.copy2(TOP / name, made.copy)
    for name in (*TOOLS, "cp"):
        found = shutil.which(name)
        if found is None:
            pytest.skip(f"no {name} on this machine")
        (made.bin / name).symlink_to(found)
    return made


def one_line(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == UNAVAILABLE
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    return line


def test_without_python_it_says_so_in_one_line(machine):
    assert "expected Python 3.11 or newer, found no Python" in one_line(machine.dev("sim"))
    assert sorted(os.listdir(machine.copy)) == ["dev", "pyproject.toml"]


def test_an_old_python_is_named(machine):
    machine.has("python3", OLD_PYTHON)
    assert "expected Python 3.11 or newer, found Python 3.9.2" in one_line(machine.dev("test"))


def test_a_newer_python_beside_an_old_one_is_found(machine):
    machine.has("python3", OLD_PYTHON)
    machine.has("python3.13", BARE_PYTHON)
    assert "python3.13 has neither ensurepip nor pip 22.3" in one_line(machine.dev("lint"))


@pytest.mark.parametrize("version", ["20.3.4", "22.2.2"])
def test_a_pip_that_cannot_install_elsewhere_is_not_taken(machine, version):
    machine.has("python3", BARE_PYTHON)
    machine.has("pip3", PIP.format(version))
    assert "install python3-venv" in one_line(machine.dev("docs"))


@pytest.mark.parametrize("version", ["22.3", "23.0.1", "100.0"])
def test_a_pip_from_outside_fills_an_environment_without_one(machine, version, tmp_path):
    machine.has("python3", BARE_PYTHON)
    machine.has("pip", PIP.format(version))
    calls = tmp_path / "calls"
    for _ in range(2):
        done = machine.dev("run", "sh", "-c", "echo ran; pwd", PIP_CALLS=str(calls))
        assert done.returncode == 0, done.stderr
        assert done.stdout.splitlines() == ["ran", str(machine.bin)]
    python = machine.copy / ".venv" / "bin" / "python"
    assert calls.read_text(encoding="utf-8").splitlines() == [
        f"--python {python} install --editable .[dev]"
    ]


def test_it_installs_again_when_the_dependencies_have_changed(machine, tmp_path):
    machine.has("python3", BARE_PYTHON)
    machine.has("pip", PIP.format("23.0"))
    calls = tmp_path / "calls"
    machine.dev("run", "sh", "-c", "", PIP_CALLS=str(calls))
    with (machine.copy / "pyproject.toml").open("a", encoding="utf-8") as project:
        project.write("# changed\n")
    machine.dev("run", "sh", "-c", "", PIP_CALLS=str(calls))
    assert len(calls.read_text(encoding="utf-8").splitlines()) == 2


def test_what_an_interrupted_installation_left_is_made_anew(machine, tmp_path):
    machine.has("python3", BARE_PYTHON)
    machine.has("pip", PIP.format("23.0"))
    half_made = machine.copy / ".venv" / "lib"
    half_made.mkdir(parents=True)
    (half_made.parent / "bin").mkdir()  # even a python that works does not make it whole
    shutil.copy2(machine.bin / "python3", half_made.parent / "bin" / "python")
    writing = machine.copy / ".venv-making"
    writing.mkdir()
    ended = subprocess.Popen(["true"])
    ended.wait()
    (writing / "pid").write_text(f"{ended.pid}\n", encoding="utf-8")
    done = machine.dev("run", "sh", "-c", "echo ran", PIP_CALLS=str(tmp_path / "calls"))
    assert done.stdout == "ran\n"
    assert "making it anew" in done.stderr
    assert not half_made.exists()
    assert not writing.exists()


def test_it_works_through_a_link_from_anywhere(machine, tmp_path):
    (tmp_path / "links").mkdir()
    first, second = tmp_path / "links" / "first", tmp_path / "dev"
    first.symlink_to("../a working copy/dev")
    second.symlink_to(first)
    machine.has("python3", BARE_PYTHON)
    machine.has("pip", PIP.format("23.0"))
    done = machine.dev(
        "run", "sh", "-c", 'echo "$VIRTUAL_ENV"', script=second, PIP_CALLS=os.devnull
    )
    assert done.stdout.strip() == str(machine.copy / ".venv")


def test_an_unknown_command_is_refused_before_anything_is_made(machine):
    done = machine.dev("simulate")
    assert done.returncode == 2
    assert "got 'simulate'" in done.stderr.splitlines()[0]
    assert machine.dev("run").returncode == 2
    assert machine.dev("help").stdout.startswith("usage: ./dev COMMAND")
    assert sorted(os.listdir(machine.copy)) == ["dev", "pyproject.toml"]
