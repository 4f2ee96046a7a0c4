"""What a user gets: source archive, then a wheel made of it, then an environment with nothing else.

Nothing is downloaded. The environment holds the wheel and what the wheel's metadata lead to, linked
from the environment the tests run in, so a dependency nobody declared is missing there as well.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement

TOP = Path(__file__).parents[2]
BUILD = (sys.executable, "-m", "hatchling", "build", "--directory")

# One worker builds it once for all of them.
pytestmark = [pytest.mark.e2e, pytest.mark.slow, pytest.mark.xdist_group("package")]


@dataclass(frozen=True, slots=True)
class Installed:
    """An environment, and a folder to work in that is not the source tree."""

    home: Path
    elsewhere: Path

    def run(self, command: str, *arguments: str) -> str:
        """Return what `command` of the environment writes to stdout; its failure is the test's."""
        return run([self.home / "bin" / command, *arguments], self.elsewhere)


def run(command: Iterable[str | Path], directory: Path) -> str:
    """Return the stdout of `command`, run in `directory` with an environment of its own."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=directory,
        env=kept | {"HOME": str(directory)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    assert done.returncode == 0, f"{command} ended with {done.returncode}:\n{done.stderr}"
    return done.stdout


def needed_by(requirements: Iterable[str]) -> dict[str, metadata.Distribution]:
    """Return every distribution that `requirements` lead to, extras left out unless asked for."""
    found: dict[str, metadata.Distribution] = {}
    waiting = [(Requirement(each), {""}) for each in requirements]
    while waiting:
        requirement, extras = waiting.pop()
        marker = requirement.marker
        if marker is not None and not any(marker.evaluate({"extra": each}) for each in extras):
            continue
        if requirement.name not in found:
            found[requirement.name] = metadata.distribution(requirement.name)
            for each in found[requirement.name].requires or []:
                waiting.append((Requirement(each), requirement.extras or {""}))
    return found


def link(distribution: metadata.Distribution, site: Path) -> None:
    """Make the files of `distribution` importable from `site`; its scripts stay behind."""
    names = {file.parts[0] for file in distribution.files or [] if ".." not in file.parts}
    for name in names - {"__pycache__"}:
        if not (site / name).exists():
            (site / name).symlink_to(Path(str(distribution.locate_file(name))))


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A source archive of this tree."""
    place = tmp_path_factory.mktemp("sdist")
    run([*BUILD, place, "--target", "sdist"], TOP)
    return next(place.glob("*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from the source archive alone."""
    place = tmp_path_factory.mktemp("wheel")
    with tarfile.open(sdist) as archive:
        # The filter came with 3.11.4, and later versions ask for it.
        archive.extraction_filter = getattr(tarfile, "data_filter", lambda member, path: member)
        archive.extractall(place)
    run([*BUILD, place, "--target", "wheel"], next(place.glob("thermoctl-*/")))
    return next(place.glob("*.whl"))


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installed]:
    """The wheel in an environment that holds nothing it did not ask for."""
    place = tmp_path_factory.mktemp("environment")
    there = Installed(place / "venv", place / "elsewhere")
    there.elsewhere.mkdir()
    run([sys.executable, "-m", "venv", "--without-pip", there.home], place)
    pip = [sys.executable, "-m", "pip", "--python", there.home / "bin" / "python"]
    run([*pip, "install", "--no-index", "--no-deps", wheel], place)
    site = next((there.home / "lib").glob("python*/site-packages"))
    (own,) = metadata.distributions(name="thermoctl", path=[str(site)])
    for distribution in needed_by(own.requires or []).values():
        link(distribution, site)
    run([*pip, "check"], place)
    return there


def test_the_source_archive_carries_what_it_takes_to_test_it(sdist):
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"dev", "README.md", "LICENSE", "tests/e2e/test_package.py"} <= names
    assert "drivers/firmware/thermodaq/Makefile" in names
    assert not [name for name in names if name.startswith((".venv", ".git/", "docs/_build"))]


def test_the_wheel_holds_two_packages_and_nothing_else(wheel):
    with ZipFile(wheel) as archive:
        roots = {name.partition("/")[0] for name in archive.namelist()}
    about = {root for root in roots if root.endswith(".dist-info")}
    assert roots - about == {"thermoctl", "thermoctl_drivers"}
    assert len(about) == 1


def test_the_wheel_carries_every_profile_the_licence_and_the_marks_of_typed_packages(wheel):
    with ZipFile(wheel) as archive:
        names = archive.namelist()
        profiles = {Path(name).name for name in names if name.startswith("thermoctl/profiles/")}
    assert profiles >= {path.name for path in (TOP / "config").glob("*.toml")}
    assert {"thermoctl/py.typed", "thermoctl_drivers/py.typed"} <= set(names)
    assert any(name.endswith("/licenses/LICENSE") for name in names)


def test_the_installed_command_says_its_version(installed, wheel):
    version = wheel.name.split("-")[1]
    assert installed.run("thermoctl", "--version").strip() == f"thermoctl, version {version}"


def test_a_minute_on_the_simulated_tank_runs_outside_the_source_tree(installed):
    lines = installed.run(
        "thermoctl", "--sim", "--speed", "max", "--duration", "60s", "--no-history"
    ).splitlines()
    *cycles, end = [json.loads(line) for line in lines]
    assert end["summary"]["steps"] == len(cycles) == 61
    assert cycles[-1]["temperature_c"] > cycles[0]["temperature_c"] + 1.0
    assert not any(installed.elsewhere.rglob("*.sqlite"))


def test_no_package_called_drivers_came_along(installed):
    code = "from importlib.util import find_spec as f; print(f('drivers'), f('tests'))"
    assert installed.run("python", "-c", code).split() == ["None", "None"]


def test_every_entry_point_loads_from_the_environment(installed):
    code = """if True:
        import json, sys
        from importlib.metadata import distribution
        found = {}
        for each in distribution("thermoctl").entry_points:
            file = sys.modules[each.load().__module__].__file__
            found.setdefault(each.group, {})[each.name] = file
        print(json.dumps(found))
    """
    found = json.loads(installed.run("python", "-c", code))
    assert set(found) == {
        "console_scripts",
        "thermoctl.controllers",
        "thermoctl.drivers",
        "thermoctl.estimators",
    }
    assert {"simulated", "null", "thermodaq"} <= set(found["thermoctl.drivers"])
    files = [Path(file) for group in found.values() for file in group.values()]
    assert all(file.is_relative_to(installed.home) for file in files)
