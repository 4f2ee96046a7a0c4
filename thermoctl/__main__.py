"""``python -m thermoctl`` is the ``thermoctl`` command."""

from thermoctl.app.cli import main

main()
