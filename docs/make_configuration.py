"""Fill the tables of docs/configuration.md from the program's own settings.

Run as ``python docs/make_configuration.py``. A line ``<!-- table: NAME -->`` begins a table and
``<!-- end -->`` ends it; NAME is that of a settings class, ``driver KIND``, ``controller KIND``,
``estimator KIND``, or ``constants KIND``: what stands in tables within that of a controller.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from thermoctl.app import plugins
from thermoctl.app.catalogue import Row, rows_of_law, rows_of_model
from thermoctl.app.configuration import tables

PAGE = Path(__file__).parent / "configuration.md"
MARKED = re.compile(
    r"(?P<begin><!-- table: (?P<name>[\w -]+) -->\n).*?(?P<end><!-- end -->)", re.DOTALL
)
HEAD = "| key | type | range | default | meaning |\n|---|---|---|---|---|\n"


def rows(name: str) -> list[Row]:
    """Return the rows of the table called `name`."""
    what, _, kind = name.partition(" ")
    if what == "driver":
        settings = rows_of_model(plugins.find(plugins.DRIVERS, kind).Settings)
        return [row for row in settings if row.key != "kind"]
    if what in ("controller", "estimator"):
        return [each for each in rows_of_law(_law(what, kind)) if "." not in each.key]
    if what == "constants":
        return [each for each in rows_of_law(_law("controller", kind)) if "." in each.key]
    return rows_of_model(getattr(tables, name))


def _law(what: str, kind: str) -> type:
    law: type = plugins.find(f"thermoctl.{what}s", kind)
    return law


def table(name: str) -> str:
    """Return the table called `name` as Markdown; keys that share a text show it once."""
    each, text = [], ""
    for row in rows(name):
        each.append(line(replace(row, text="as above") if row.text == text else row))
        text = row.text
    return "\n" + HEAD + "".join(f"{row}\n" for row in each) + "\n"


def line(row: Row) -> str:
    """Return one key as a row of a Markdown table."""
    kind = f"{row.type}, {row.unit}" if row.unit else row.type
    default = f"`{row.default}`" if row.default not in ("", "required") else row.default
    text = row.text.replace("``", "`").replace("|", "\\|")
    return f"| `{row.key}` | {kind} | {row.bounds} | {default} | {text} |"


def filled(page: str) -> str:
    """Return `page` with every marked table written anew."""
    return MARKED.sub(lambda mark: mark["begin"] + table(mark["name"]) + mark["end"], page)


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
