"""Every finished cycle on disk, without ever making the loop wait.

`writer` is a bounded feed, a thread and a commit a second, into a `file` that is opened or set
aside. `reader` has columns for a study and CSV for everybody else. `schema` are the tables, and
what a cycle looks like in them.
"""

from thermoctl.services.history.reader import Recording, export, read_history
from thermoctl.services.history.schema import COLUMNS, SCHEMA_VERSION, RunInfo
from thermoctl.services.history.writer import HistoryWriter, Opened, open_history

__all__ = [
    "COLUMNS",
    "SCHEMA_VERSION",
    "HistoryWriter",
    "Opened",
    "Recording",
    "RunInfo",
    "export",
    "open_history",
    "read_history",
]
