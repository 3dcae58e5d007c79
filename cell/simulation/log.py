"""The record of a run: deterministic arrays, sampled at a fixed period."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike


class Log:
    """Rows of named values, and the phases they belong to.

    Attributes:
        phases: (name, start time) of every phase, in order.
    """

    def __init__(self) -> None:
        self._rows: dict[str, list[np.ndarray]] = {}
        self.phases: list[tuple[str, float]] = []

    def append(self, **values: ArrayLike) -> None:
        """Add one row; every row must have the same names."""
        for name, value in values.items():
            self._rows.setdefault(name, []).append(np.array(value, dtype=float))

    def mark(self) -> tuple[int, int]:
        """Return how much there is so far, for `cut`."""
        return max(map(len, self._rows.values()), default=0), len(self.phases)

    def cut(self, mark: tuple[int, int]) -> None:
        """Forget what has come since a mark."""
        rows, phases = mark
        for column in self._rows.values():
            del column[rows:]
        del self.phases[phases:]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return every column as an array (rows first), and the phases as two arrays."""
        columns = {name: np.array(rows) for name, rows in self._rows.items()}
        columns["phase_name"] = np.array([name for name, _ in self.phases])
        columns["phase_start"] = np.array([start for _, start in self.phases])
        return columns

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from what `arrays` returned."""
        columns = dict(arrays)
        starts = columns.pop("phase_start").tolist()
        self.phases = list(zip(columns.pop("phase_name").tolist(), starts, strict=True))
        self._rows = {name: list(rows) for name, rows in columns.items()}
