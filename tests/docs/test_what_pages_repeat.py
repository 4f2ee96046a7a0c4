"""What pages repeat of the program: figures and examples that would grow old by themselves."""

import importlib.util
import re
import tomllib
from pathlib import Path

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load

TOP = Path(__file__).parents[2]
TOML = re.compile(r"^```toml\n(.*?)^```", re.DOTALL | re.MULTILINE)


def test_the_caption_pours_when_the_picture_does():
    place = TOP / "docs" / "make_live_picture.py"
    spec = importlib.util.spec_from_file_location(place.stem, place)
    picture = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(picture)
    caption = (TOP / "README.md").read_text(encoding="utf-8").partition("## Two commands")[0]
    minutes = re.findall(r"(\d+) minutes", caption)
    assert minutes == [f"{picture.POUR_AT_S / 60:g}"]


def test_the_line_that_puts_the_law_of_the_paper_in_the_shadow_does_so():
    (example,) = TOML.findall((TOP / "docs" / "control.md").read_text(encoding="utf-8"))
    least = {"loops": {"tank": {"setpoint_c": 37.5, "trip_above_c": 60.0}}}
    least["loops"]["tank"] |= tomllib.loads(example)["loops"]["tank"]
    shadow = plan_for(load(least).loops["tank"]).shadow
    assert (shadow.name, shadow.reference_time_s) == ("self-tuning-mv", 60.0)


def test_the_walk_of_a_sample_has_the_numbers_that_stand_beside_its_code():
    page = (TOP / "docs" / "architecture.md").read_text(encoding="utf-8")
    steps = re.findall(r"^(\d+)\. \*\*(.+?)\.\*\*", page, re.MULTILINE)
    noted = {}
    for name in ("runtime/loop.py", "regulator/regulator.py"):
        source = (TOP / "thermoctl" / name).read_text(encoding="utf-8")
        noted |= dict(re.findall(r"  # (\d+)\. (.+)$", source, re.MULTILINE))
    assert [(n, noted.get(n)) for n, _ in steps] == [(n, title.lower()) for n, title in steps]
    assert len(noted) == len(steps)
