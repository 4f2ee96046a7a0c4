"""What pages say: links lead somewhere, files exist, commands are spelt right, examples run."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from thermoctl.app.cli import cli

TOP = Path(__file__).parents[2]
PAGES = sorted(
    [
        *TOP.glob("*.md"),
        *(TOP / "drivers").rglob("*.md"),
        *(path for path in (TOP / "docs").rglob("*.md") if "_build" not in path.parts),
    ]
)
SOURCES = sorted([*(TOP / "thermoctl").rglob("*.py"), *(TOP / "drivers").rglob("*.py")])

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)
FENCE = re.compile(
    r"^(?P<tail> *```+)(?P<kind>[\w{}-]*)\n(?P<body>.*?)^(?P=tail)", re.DOTALL | re.M
)
SCRIPT = re.compile(r"<!-- run -->\n+```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
FILE = re.compile(r"`([\w.-]+(?:/[\w.-]+)+/?)`")
MENTION = re.compile(r"\bdocs/[\w/-]+\.md\b")

# Where a page may begin the path of a file: from the top, or from a room the page is about.
ROOTS = [TOP, TOP / "thermoctl", TOP / "drivers", TOP / "drivers" / "firmware" / "thermodaq"]
KNOWN_SUFFIXES = {".c", ".h", ".md", ".py", ".rules", ".service", ".toml"}


def named(path: Path) -> str:
    return str(path.relative_to(TOP))


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def anchors(page: Path) -> set[str]:
    """Return the anchors of the headings of `page`, made as forges and MyST make them."""
    headings = HEADING.findall(FENCE.sub("", text_of(page)))
    return {re.sub(r"[^\w\- ]", "", each.lower()).strip().replace(" ", "-") for each in headings}


def shell_lines(page: Path) -> Iterator[str]:
    """Yield the lines of the shell blocks of `page`, continued ones joined."""
    for block in FENCE.finditer(text_of(page)):
        if block["kind"] in ("sh", "bash", "console"):
            for line in block["body"].replace("\\\n", " ").splitlines():
                yield line.strip().removeprefix("$ ")


def commands(page: Path) -> Iterator[list[str]]:
    """Yield the words of every ``thermoctl`` call in the shell blocks of `page`."""
    for line in shell_lines(page):
        yield from calls(line)


def bench_tests() -> list[list[str]]:
    """Return every bench test on a page that ends by itself and needs no terminal."""
    found = {tuple(words): words for page in PAGES for words in commands(page)}
    return [words for words in found.values() if {"--sim", "--duration"} <= set(words)]


def calls(line: str) -> Iterator[list[str]]:
    """Yield the arguments of every ``thermoctl`` in a shell line, up to a pipe or the like."""
    spaced = shlex.shlex(line, posix=True, punctuation_chars=True)
    spaced.whitespace_split = True
    current: list[str] | None = None
    for word in [*spaced, ";"]:
        if current is not None and set(word) <= set("|&;<>()"):
            yield current
            current = None
        elif current is not None:
            current.append(word)
        elif word == "thermoctl" or word.endswith("/thermoctl"):
            current = []


def misspelt(words: list[str]) -> list[str]:
    """Return the commands and options among `words` that the command line does not have."""
    command: click.Command = cli
    context = click.Context(command)
    wrong = []
    for word in words:
        if word.startswith("-") and not word.lstrip("-")[:1].isdigit():
            options = {each for option in command.get_params(context) for each in option.opts}
            if word.partition("=")[0] not in options:
                wrong.append(word)
        elif isinstance(command, click.Group) and word.isalnum():
            known = command.get_command(context, word)
            if known is not None:
                command, context = known, click.Context(known, parent=context)
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_a_link_leads_to_a_page_and_a_heading_that_are_there(page):
    broken = []
    for target in LINK.findall(FENCE.sub("", text_of(page))):
        if re.match(r"\w+:", target):  # the network is not asked
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        if not there.exists() or (anchor and anchor not in anchors(there)):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_a_file_that_a_page_names_is_there(page):
    missing = []
    for name in FILE.findall(text_of(page)):
        if Path(name).suffix in KNOWN_SUFFIXES or name.endswith("/"):
            within = [page.parent, *ROOTS]
            if not any((root / name).exists() for root in within) and "build/" not in name:
                missing.append(name)
    assert missing == []


def test_a_page_that_the_code_names_is_there():
    missing = {
        f"{named(source)}: {mention}"
        for source in SOURCES
        for mention in MENTION.findall(text_of(source))
        if not (TOP / mention).is_file()
    }
    assert missing == set()


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_on_a_page_have_the_options_they_are_given(page):
    wrong = {" ".join(words): misspelt(words) for words in commands(page)}
    assert {command: words for command, words in wrong.items() if words} == {}


def test_some_page_has_an_example_that_is_marked_to_run():
    assert any(SCRIPT.findall(text_of(page)) for page in PAGES)


@pytest.mark.parametrize("page", [p for p in PAGES if SCRIPT.findall(text_of(p))], ids=named)
def test_examples_marked_to_run_do_run(page, tmp_path, monkeypatch):
    run_examples(SCRIPT.findall(text_of(page)), tmp_path, monkeypatch)


def test_every_example_of_the_front_page_runs(tmp_path, monkeypatch):
    blocks = FENCE.finditer(text_of(TOP / "README.md"))
    examples = [block["body"] for block in blocks if block["kind"] == "python"]
    assert examples
    run_examples(examples, tmp_path, monkeypatch)


@pytest.mark.e2e
@pytest.mark.parametrize("words", bench_tests(), ids=" ".join)
def test_a_bench_test_on_a_page_runs_to_its_end(words, tmp_path):
    (tmp_path / "config").symlink_to(TOP / "config")
    done = subprocess.run(
        [sys.executable, "-m", "thermoctl", *words],
        cwd=tmp_path,
        env=os.environ | {"XDG_STATE_HOME": str(tmp_path)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "summary" in json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_scripts_that_a_page_calls_are_there(page):
    called = [
        word
        for line in shell_lines(page)
        for word in line.partition("#")[0].split()
        if line.startswith(("./dev", "python")) and word.endswith((".py", "dev"))
    ]
    assert [word for word in called if not (TOP / word).is_file()] == []


def run_examples(examples: list[str], directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run `examples`, one after the other, where the profiles lie as they do in the source tree."""
    (directory / "config").symlink_to(TOP / "config")
    monkeypatch.chdir(directory)
    shared: dict[str, object] = {"__name__": "example"}
    for example in examples:
        exec(compile(example, "example", "exec"), shared)


def test_a_misspelt_option_would_be_noticed():
    (words,) = calls("sudo thermoctl --sim --sped 60 --json | head -n 3")
    assert words == ["--sim", "--sped", "60", "--json"]
    assert misspelt(words) == ["--sped"]


def test_every_decision_has_a_place_among_the_subjects():
    folder = TOP / "docs" / "decisions"
    listed = re.findall(r"\((\d{4}-[^)]*)\)", text_of(folder / "README.md"))
    assert sorted(listed) == sorted(path.name for path in folder.glob("0*.md"))
