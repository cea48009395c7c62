"""The last samples of a few quantities over time, in bounded memory."""

from __future__ import annotations

import math

from winding_core.history import History

NAN = float("nan")
_Row = tuple[float, ...]


class Trace:
    """The newest rows (t, value, value, ...).

    Args:
        columns: Names of the values.
        capacity: Rows kept; the oldest goes first.
    """

    def __init__(self, *columns: str, capacity: int = 600) -> None:
        self.columns = columns
        self._capacity = capacity
        self.clear()

    @property
    def rows(self) -> list[_Row]:
        """Times and values, oldest first."""
        return self._history.newest(self._capacity)

    def __len__(self) -> int:
        return min(len(self._history), self._capacity)

    @property
    def first_time(self) -> float:
        """Time of the oldest row [s]; nan when there is none."""
        return self.rows[0][0] if self._history else NAN

    @property
    def last_time(self) -> float:
        """Time of the newest row [s]; nan when there is none."""
        return self._history[-1][0] if self._history else NAN

    def append(self, t: float, *values: float) -> None:
        """Add a row of time t [s]; a missing value is nan.

        Raises:
            ValueError: There are more or fewer values than columns.
        """
        if len(values) != len(self.columns):
            raise ValueError(f"row needs {len(self.columns)} values, got {len(values)}")
        self._history.append((t, *values))

    def clear(self) -> None:
        """Forget all rows."""
        self._history: History[_Row] = History(newest=self._capacity)

    def points(
        self, column: str, scale: float = 1.0, origin: float = 0.0
    ) -> list[list[float | None]]:
        """Return [t - origin, scale x value] of every row; None where the value is missing."""
        index = self.columns.index(column) + 1
        return [
            [
                round(row[0] - origin, 3),
                None if math.isnan(row[index]) else round(scale * row[index], 5),
            ]
            for row in self.rows
        ]
