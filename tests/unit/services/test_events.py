"""The registry of events, its page and the source agree with each other."""

from __future__ import annotations

import ast
import re
from itertools import pairwise
from pathlib import Path

from thermoctl.services.events import EVENTS, PRIORITIES, REASONS, RESERVED, level_of

ROOT = Path(__file__).parents[3]
NAME = re.compile(r"[a-z]+\.[a-z_]+")
ROW = re.compile(r"\| `([a-z.0-9_]+)` \| (\w+) \|", re.MULTILINE)
FILE_NAMES = re.compile(r".*\.(sqlite|lock|toml|json|csv|svg|png|elf)")
FAMILIES = {name.split(".")[0] for name in (*EVENTS, *REASONS)}
TELLERS = {
    *("Event", "Alarm", "emit", "_emit", "report", "_report", "_tell", "note"),
    *("fail", "fault", "latch", "_raise"),
}


def called(call: ast.Call) -> str:
    match call.func:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
    return ""


def dotted(nodes) -> set[str]:
    """Return the constants among `nodes` that read like the name of an event."""
    texts = {node.value for node in nodes if isinstance(node, ast.Constant)}
    return {
        text
        for text in texts
        if isinstance(text, str) and NAME.fullmatch(text) and not FILE_NAMES.fullmatch(text)
    }


def names_in(source: str) -> set[str]:
    """Return what is told as an event anywhere, and every other name of a known family."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and called(node) in TELLERS:
            names |= dotted([*node.args, *(keyword.value for keyword in node.keywords)])
        names |= {name for name in dotted([node]) if name.split(".")[0] in FAMILIES}
    return names


def test_every_event_in_the_source_is_registered():
    rooms = (ROOT / "thermoctl", ROOT / "drivers" / "thermoctl_drivers")
    sources = [path for room in rooms for path in room.rglob("*.py")]
    found = {path: names_in(path.read_text(encoding="utf-8")) for path in sources}
    unknown = {str(path): names - set(EVENTS) - REASONS for path, names in found.items()}
    assert {path: names for path, names in unknown.items() if names} == {}
    assert any(found.values())


def test_every_event_is_told_somewhere_unless_it_is_reserved():
    """Names in the registry, in advice and in the live view's sentences tell nothing themselves."""
    lists = {"events.py", "advice.py", "sentences.py"}
    rooms = (ROOT / "thermoctl", ROOT / "drivers" / "thermoctl_drivers")
    sources = [path for room in rooms for path in room.rglob("*.py") if path.name not in lists]
    told = set().union(*(names_in(path.read_text(encoding="utf-8")) for path in sources))
    put_together = {f"sensor.{which}_lost" for which in ("first", "second")}
    assert set(EVENTS) - told - put_together == RESERVED


def test_the_search_finds_an_event_however_it_is_told():
    source = """
Event(0.0, "moon.landed")
self._emit("tide.turned", x=1)
Alarm(code="wolf.cried", fault=None)
TABLE = {"sensor.melted": 1, "axes.grid": 2, "history.sqlite": 3}
"""
    assert names_in(source) == {"moon.landed", "tide.turned", "wolf.cried", "sensor.melted"}


def test_the_page_lists_every_event_with_its_level_in_order():
    page = (ROOT / "docs" / "events.md").read_text(encoding="utf-8")
    rows = [(name, level) for name, level in ROW.findall(page) if level in PRIORITIES]
    assert rows == sorted(EVENTS.items())


def test_the_page_lists_every_reason():
    page = (ROOT / "docs" / "events.md").read_text(encoding="utf-8")
    _, reasons = page.split("## Reasons")
    assert set(re.findall(r"^\| `([a-z._]+)` \|", reasons, re.MULTILINE)) == REASONS


def numbered(source: str) -> set[tuple[str, int]]:
    """Return the codes that are followed by a number, in calls, tuples and mappings."""
    pairs = set()
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Call(args=nodes) | ast.Tuple(elts=nodes):
                pairs |= set(pairwise(nodes))
            case ast.Dict(keys=keys, values=values):
                pairs |= set(zip(keys, values, strict=True))
    constants = {
        (each[0].value, each[1].value)
        for each in pairs
        if all(isinstance(one, ast.Constant) for one in each)
    }
    return {(c, n) for c, n in constants if c in EVENTS and type(n) is int}


def test_the_page_lists_every_fault_number():
    page = (ROOT / "docs" / "events.md").read_text(encoding="utf-8")
    table = page.split("## Fault numbers")[1].split("## Reasons")[0]
    rows = re.findall(r"^\| (\d+) \| [^|]+ \| (.+) \|$", table, re.MULTILINE)
    told = {(code, int(n)) for n, codes in rows for code in re.findall(r"`([a-z._]+)`", codes)}
    rooms = [ROOT / "thermoctl" / room for room in ("regulator", "runtime")]
    given = {
        pair
        for room in rooms
        for path in room.rglob("*.py")
        for pair in numbered(path.read_text(encoding="utf-8"))
    }
    assert {("board.lost", 13), ("heater.reversed", 3), ("sensor.open", 1)} <= given
    assert given <= told
    assert {code for code, _ in told} <= set(EVENTS)


def test_an_unknown_name_is_a_warning():
    assert level_of("plugin.surprised") == "warning"
    assert level_of("sensor.open") == "error"
