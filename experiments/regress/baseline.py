"""What is stored of a regression run, and what a run now is compared with it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cell.errors import InputError
from experiments.campaigns.trial import Row
from experiments.compare.tolerances import NAMED

Metrics = dict[str, dict[str, float]]  # Case -> metric -> mean over its trials.
Ratios = dict[str, float]  # Class -> kernel iterations per simulated second.


@dataclass(frozen=True)
class Baseline:
    """What is stored.

    Attributes:
        cases: Metrics.
        drake: The version of Drake with which they were made.
        trials: Of each case.
        speed: Ratios of CPU time; empty: not stored yet.
    """

    cases: Metrics
    drake: str
    trials: int = 1
    speed: Ratios = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of its file."""
        return {
            "drake": self.drake,
            "trials": self.trials,
            "speed": self.speed,
            "cases": self.cases,
        }


def read_baseline(path: Path) -> Baseline:
    """Return what is stored.

    Raises:
        InputError: The file is missing or cannot be read.
    """
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        cases = {case: _numbers(metrics) for case, metrics in stored["cases"].items()}
        return Baseline(cases, str(stored["drake"]), int(stored["trials"]), stored["speed"])
    except FileNotFoundError:
        raise InputError(f"No stored metrics '{path}': make them with --update.") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        reason = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(f"Cannot read the stored metrics '{path}': {reason}.") from error


def _numbers(metrics: Mapping[str, Any]) -> dict[str, float]:
    found = {name: float(value) for name, value in metrics.items()}
    if not all(map(math.isfinite, found.values())):
        raise ValueError("a metric is not finite")
    return found


def metrics_of(rows: Sequence[Row]) -> dict[str, float]:
    """Return the stored metrics of a case: means over the trials that have them."""
    found = {"success_rate": float(np.mean([row.verdict == "success" for row in rows]))}
    for tolerance in NAMED:
        name = tolerance.quantity
        values = [row.measured[name] for row in rows if row.measured.get(name) is not None]
        if values:
            found[name] = float(np.mean(np.array(values, dtype=float)))
    return found
