"""What holds for all tests."""

from contextlib import suppress

import pytest
from hypothesis import settings

# A deadline would make a law of the field out of the speed of a machine.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="module")
def histories_closed():
    """Close what writers that never ran a thread of their own leave open in a module."""
    import sqlite3

    from thermoctl.services.history import file

    opened, connect = [], file._connect

    def remembered(path):
        opened.append(connect(path))
        return opened[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(file, "_connect", remembered)
        yield
    for connection in opened:
        with suppress(sqlite3.ProgrammingError):  # of a thread, which has closed it
            connection.close()
