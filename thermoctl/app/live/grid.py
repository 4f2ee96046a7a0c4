"""The inside of a chart: cells that are painted once, most important first."""

from __future__ import annotations

from collections.abc import Sequence

from thermoctl.app.live.look import Role

Part = tuple[str, Role]


class Grid:
    """Cells of one character and one role each.

    A cell keeps what was painted first: a line is painted before the marks it may hide.
    """

    def __init__(self, rows: int, columns: int) -> None:
        self.rows, self.columns = rows, columns
        self._cells = [[" "] * columns for _ in range(rows)]
        self._roles = [[Role.PAGE] * columns for _ in range(rows)]

    def put(self, row: int, column: int, string: str, role: Role) -> None:
        """Write `string` from `column` on, into empty cells only, and cut at the edge."""
        cells, roles = self._cells[row], self._roles[row]
        for at, character in enumerate(string, column):
            if 0 <= at < self.columns and character != " " and cells[at] == " ":
                cells[at], roles[at] = character, role

    def paint(self, lines: Sequence[str], role: Role) -> None:
        """Write one string a row, from the left edge."""
        for row, line in enumerate(lines):
            self.put(row, 0, line, role)

    def free(self, row: int, first: int, last: int) -> bool:
        """Return whether the cells `first` to `last`, inclusive, exist and are empty."""
        inside = 0 <= row < self.rows and 0 <= first <= last < self.columns
        return inside and all(cell == " " for cell in self._cells[row][first : last + 1])

    def parts(self, row: int) -> list[Part]:
        """Return a row as runs of one role."""
        cells, roles = self._cells[row], self._roles[row]
        runs: list[Part] = []
        begin = 0
        for at in range(1, self.columns + 1):
            if at == self.columns or roles[at] is not roles[begin]:
                runs.append(("".join(cells[begin:at]), roles[begin]))
                begin = at
        return runs
