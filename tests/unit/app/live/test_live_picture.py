from xml.etree import ElementTree

from thermoctl.app.live.look import Look, Role
from thermoctl.app.live.model import LiveModel
from thermoctl.app.live.picture import svg
from thermoctl.app.live.render import render

SVG = "{http://www.w3.org/2000/svg}"


def test_a_picture_holds_every_word_and_every_dot(sixty: LiveModel) -> None:
    look = Look()
    rows = render(sixty.view(59.0), 100, 30, look)
    tree = ElementTree.fromstring(svg(rows, look, "a < b & c"))
    drawn = sorted(element.text or "" for element in tree.iter(f"{SVG}text"))
    dots = sum(element.get("d", "").count("M") for element in tree.iter(f"{SVG}path"))
    picture = "".join(row.plain for row in rows)
    braille = [c for c in picture if 0x2800 <= ord(c) <= 0x28FF]
    assert dots == sum((ord(c) - 0x2800).bit_count() for c in braille)
    blank = "".join(" " if c in braille else c for c in picture)
    assert sorted("".join(drawn)) == sorted("".join(blank.split()))
    assert tree.findtext(f"{SVG}title") == "a < b & c"


def test_a_word_stands_where_its_cell_is() -> None:
    look = Look()
    tree = ElementTree.fromstring(svg([look.text(("ab  cd", Role.TEXT))], look, "t"))
    first, second = tree.iter(f"{SVG}text")
    assert float(second.get("x", "0")) - float(first.get("x", "0")) == 4 * 8.4
