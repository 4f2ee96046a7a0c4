"""The ``thermoctl`` command, as ``python -m thermoctl`` and by its name."""

import sys

_INTERRUPTED = 130


def main() -> None:
    """Load the program and run it; Ctrl-C while it loads ends as it does later on."""
    try:
        from thermoctl.app.cli import main as run
    except KeyboardInterrupt:
        sys.stderr.write("\nthermoctl: interrupted\n")
        sys.exit(_INTERRUPTED)
    run()


if __name__ == "__main__":
    main()
