import pytest

from thermoctl.app.live.look import Colour, Look, Role, look_for


@pytest.mark.parametrize(
    ("environ", "colour"),
    [
        ({"COLORTERM": "truecolor"}, Colour.TRUE),
        ({"COLORTERM": "24bit", "NO_COLOR": ""}, Colour.TRUE),
        ({"COLORTERM": "truecolor", "NO_COLOR": "1"}, Colour.NONE),
        ({"TERM": "dumb"}, Colour.NONE),
        ({"TERM": "xterm"}, Colour.ANSI),
        ({}, Colour.ANSI),
    ],
)
def test_the_environment_decides_the_colours(environ: dict[str, str], colour: Colour) -> None:
    assert look_for("utf-8", environ) == Look(colour, utf8=True)


@pytest.mark.parametrize("encoding", ["ascii", "ISO-8859-1", "", None])
def test_anything_but_utf8_gets_ascii(encoding: str | None) -> None:
    assert not look_for(encoding, {}).utf8
    assert look_for("UTF-8", {}).utf8
    assert look_for("utf8", {}).utf8


def test_ascii_keeps_the_meaning_of_every_symbol() -> None:
    line = Look(Colour.NONE, utf8=False).text(("−9 mK ± 2σ △ ■ ◆ 5\u00a0µs λ*", Role.TEXT))
    assert line.plain == "-9 mK +- 2s ! # * 5 us lambda*"


def test_control_characters_do_not_reach_the_terminal() -> None:
    line = Look().text(("a\x1b[2Jb\nc\u202ed", Role.TEXT))
    assert line.plain == "a [2Jb c d"
