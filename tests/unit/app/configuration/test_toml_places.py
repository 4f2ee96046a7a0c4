"""Lines of keys in a TOML file."""

from __future__ import annotations

import tomllib

from hypothesis import given
from hypothesis import strategies as st

from thermoctl.app.configuration.toml_places import line_of, places
from thermoctl.app.configuration.toml_text import toml_text

NAMES = st.text('abcdefgh_-0123456789 ."é', min_size=1, max_size=8).filter(lambda n: '"' not in n)
TABLES = st.dictionaries(NAMES, st.dictionaries(NAMES, st.integers() | st.booleans(), min_size=1))


def test_tables_keys_and_dotted_keys_are_found_on_their_lines():
    text = '# title\n[loops.tank] # one\nsetpoint_c = 1\nsensor.board = "x"\n\n[[more]]\na = 1\n'
    assert places(text) == {
        ("loops", "tank"): 2,
        ("loops", "tank", "setpoint_c"): 3,
        ("loops", "tank", "sensor", "board"): 4,
        ("more",): 6,
        ("more", "a"): 7,
    }


def test_a_key_inside_a_string_of_several_lines_is_none():
    text = 'a = """\n[b]\nc = 1\n"""\nc = 2\n'
    assert places(text) == {("a",): 1, ("c",): 5}


def test_a_string_of_several_lines_ends_at_its_own_quotes():
    assert places('a = """\n\'\'\'\nb = 1\n"""\nb = 2\n')[("b",)] == 5


def test_a_key_that_is_not_written_down_is_placed_at_its_table():
    found = places("[a]\nb = { c = 1 }\n")
    assert line_of(found, ("a", "b", "c")) == 2
    assert line_of(found, ("a", "x")) == 1
    assert line_of(found, ("x",)) is None


def test_quoted_names_keep_their_dots():
    assert places('[loops."my.tank"]\n"set point" = 1\n') == {
        ("loops", "my.tank"): 1,
        ("loops", "my.tank", "set point"): 2,
    }


@given(TABLES)
def test_every_key_of_a_written_document_stands_on_the_line_that_is_told(tables):
    text = toml_text(tables)
    assert tomllib.loads(text) == tables
    lines, found = text.splitlines(), places(text)
    for name, table in tables.items():
        for key in table:
            line = lines[found[(name, key)] - 1]
            assert tomllib.loads(line) == {key: table[key]}
