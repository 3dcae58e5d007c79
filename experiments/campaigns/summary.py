"""What a campaign found: success rates with their intervals, failures by phase, quantities."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from experiments.campaigns.store import columns_of
from experiments.campaigns.trial import VERDICTS, Row
from experiments.reporting.statistics import wilson

LONGEST_LIST = 20  # Keys of trials named per phase.
STATE = "state.npz"  # Names of saved states end so.


def summary_of(rows: Sequence[Row], trials: int, running: bool) -> dict[str, Any]:
    """Return the summary of the trials that have ended.

    Args:
        rows: Of these.
        trials: How many the campaign has.
        running: Whether the others are still to be run, by this process.
    """
    return {
        "verdict": "running" if running else verdict_of(rows, trials),
        "trials": trials,
        "ended": len(rows),
        **{verdict: sum(row.verdict == verdict for row in rows) for verdict in VERDICTS},
        **rate_of(rows),
        "cpu_seconds": sum(row.cpu_seconds for row in rows),
        "failures_by_phase": failures_by_phase(rows),
        "by_parameter": by_parameter(rows),
        "points": points(rows),
        "measured": measured(rows),
    }


def verdict_of(rows: Sequence[Row], trials: int) -> str:
    """Return the verdict on a campaign: on all of its trials.

    Args:
        rows: Of the trials that have ended.
        trials: How many there are.

    Returns:
        "success" if every trial succeeded; "failure" if one failed; "error" if one came to no
        verdict; "interrupted" if some have not ended.
    """
    if len(rows) < trials:
        return "interrupted"
    if all(row.verdict == "success" for row in rows):
        return "success"
    return "failure" if all(row.done for row in rows) else "error"


def rate_of(rows: Sequence[Row]) -> dict[str, Any]:
    """Return success rate and Wilson's interval over the trials that came to a verdict."""
    decided = [row.verdict == "success" for row in rows if row.done]
    if not decided:
        return {"success_rate": None, "success_interval": None}
    interval = list(wilson(sum(decided), len(decided)))
    return {"success_rate": sum(decided) / len(decided), "success_interval": interval}


def failures_by_phase(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return one entry per phase in which trials failed, the most frequent first."""
    phases: dict[str, list[Row]] = {}
    for row in rows:
        if row.verdict != "success":
            phases.setdefault(f"{row.phase}" if row.done else row.verdict, []).append(row)
    return [
        {
            "phase": phase,
            "trials": len(found),
            "evidence": found[0].evidence,
            "keys": [row.key for row in found[:LONGEST_LIST]],
            "states": [f for row in found[:LONGEST_LIST] for f in row.files if f.endswith(STATE)],
        }
        for phase, found in sorted(phases.items(), key=lambda item: -len(item[1]))
    ]


def by_parameter(rows: Sequence[Row]) -> dict[str, list[dict[str, Any]]]:
    """Return the success rate at each value of every parameter that has fewer values than rows."""
    found = {}
    for name in dict.fromkeys(name for row in rows for name in row.varied):
        groups = _grouped(rows, [name])
        if 1 < len(groups) < len(rows):
            found[name] = groups
    return found


def points(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the success rate at each combination of parameters, over the seeds."""
    return _grouped(rows, list(dict.fromkeys(name for row in rows for name in row.varied)))


def _grouped(rows: Sequence[Row], names: Sequence[str]) -> list[dict[str, Any]]:
    """Return the success rate of each group of trials that have the same values."""
    groups: dict[Hashable, list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(_plain(row.varied.get(name)) for name in names), []).append(row)
    return [
        {
            "parameters": {name: found[0].varied.get(name) for name in names},
            "trials": len(found),
            "successes": sum(row.verdict == "success" for row in found),
            **rate_of(found),
        }
        for found in groups.values()
    ]


def _plain(value: Any) -> Hashable:
    return tuple(value) if isinstance(value, list) else value


def measured(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """Return number, mean, standard deviation and extremes of every measured quantity."""
    columns = columns_of(rows)
    found = {}
    for name in dict.fromkeys(name for row in rows for name in row.measured):
        values = np.array([value for value in columns[name] if value is not None])
        if len(values):
            found[name] = {
                "trials": len(values),
                "mean": float(values.mean()),
                "deviation": float(values.std(ddof=1)) if len(values) > 1 else 0.0,
                "smallest": float(values.min()),
                "largest": float(values.max()),
            }
    return found
