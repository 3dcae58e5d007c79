"""What is worth drawing of a step: plain curves, which reports turn into pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Plot:
    """Curves over a common axis.

    Attributes:
        caption: What is to be seen.
        x_label, y_label: With units.
        curves: Label -> x (n,) and y (n,).
        level: Label and height of a line to compare with; None for none.
    """

    caption: str
    x_label: str
    y_label: str
    curves: Mapping[str, tuple[np.ndarray, np.ndarray]]
    level: tuple[str, float] | None = None
