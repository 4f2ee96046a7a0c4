"""How the command begins: what happens before any of it is loaded."""

import sys
from types import ModuleType

import pytest

from thermoctl.__main__ import main


class Loading(ModuleType):
    """A module that is interrupted while it loads."""

    def __getattr__(self, name):
        raise KeyboardInterrupt


def test_ctrl_c_while_the_program_loads_is_told_in_a_line(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "thermoctl.app.cli", Loading("thermoctl.app.cli"))
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130
    assert capsys.readouterr().err == "\nthermoctl: interrupted\n"
