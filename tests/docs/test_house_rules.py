"""The rules of the house that no linter knows."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
CODE = [TOP / "thermoctl", TOP / "drivers" / "thermoctl_drivers"]
MODULES = sorted(path for root in CODE for path in root.rglob("*.py"))
FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef

MAPPED = sorted(
    path.parent
    for root in CODE
    for path in root.rglob("__init__.py")
    if path.parent != TOP / "thermoctl"
    and not {"app", "testing"} & set(path.relative_to(TOP).parts)
)
"""Rooms whose docstring says what each of their modules is for, by its name in backquotes."""

MODULE_LINES, FUNCTION_LINES, SENTENCE = 400, 40, 80

TEXT = {".c", ".h", ".md", ".py", ".rules", ".service", ".sh", ".toml", ""}
SOMEBODYS_HOME = re.compile(r"(?<![\w.])/(?:root|work|home/\w+|Users/\w+)(?=/|\b)")


def named(path: Path) -> str:
    return str(path.relative_to(TOP))


def documented(body: list[ast.stmt], prefix: str) -> Iterator[tuple[str, str]]:
    """Yield the name and the docstring of everything public in `body`."""
    for node in body:
        if isinstance(node, FUNCTION | ast.ClassDef) and not node.name.startswith("_"):
            text = ast.get_docstring(node)
            if text is not None:
                yield prefix + node.name, text
            if isinstance(node, ast.ClassDef):
                yield from documented(node.body, f"{prefix}{node.name}.")


def first_lines(path: Path) -> dict[str, str]:
    """Return the first docstring line of the module and of everything public in it."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    texts = {"(module)": ast.get_docstring(tree) or "", **dict(documented(tree.body, ""))}
    return {name: text.partition("\n")[0] for name, text in texts.items()}


def lines_without_docstring(function: FUNCTION) -> int:
    """Return how much of a screen the code of `function` takes."""
    first = function.body[0]
    documented = ast.get_docstring(function, clean=False) is not None
    text = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
    return (function.end_lineno or 0) - function.lineno + 1 - text


def text_files() -> Iterator[Path]:
    """Yield what the project consists of; what tools leave behind is in hidden folders or build."""
    for path in TOP.rglob("*"):
        parts = path.relative_to(TOP).parts
        left_behind = any(part.startswith(".") or part in ("build", "_build") for part in parts)
        if path.is_file() and path.suffix in TEXT and (not left_behind or parts[0] == ".ci"):
            yield path


@pytest.mark.parametrize("path", MODULES, ids=named)
def test_a_module_fits_on_a_desk_and_a_function_on_a_screen(path):
    source = path.read_text(encoding="utf-8")
    assert len(source.splitlines()) <= MODULE_LINES
    functions = [each for each in ast.walk(ast.parse(source)) if isinstance(each, FUNCTION)]
    lengths = {each.name: lines_without_docstring(each) for each in functions}
    assert {name: n for name, n in lengths.items() if n > FUNCTION_LINES} == {}


def test_every_public_docstring_begins_with_one_short_sentence():
    wrong = [
        f"{named(path)} {name}: {len(first)} characters: {first}"
        for path in MODULES
        for name, first in first_lines(path).items()
        if not (first.endswith(".") and len(first) < SENTENCE)
    ]
    assert not wrong, "\n".join([f"{len(wrong)} first lines:", *wrong])


@pytest.mark.parametrize("room", MAPPED, ids=named)
def test_the_docstring_of_a_room_is_a_map_of_all_its_modules(room):
    text = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8")))
    on_the_map = set(re.findall(r"`(\w+)[`.]", text or ""))
    there = {path.stem for path in room.glob("[!_]*.py")}
    there |= {path.parent.name for path in room.glob("*/__init__.py")}
    assert there - on_the_map == set()


def test_no_file_names_the_home_of_somebody():
    found = [
        f"{named(path)}:{number}: {line.strip()}"
        for path in text_files()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if SOMEBODYS_HOME.search(line)
    ]
    assert found == []
