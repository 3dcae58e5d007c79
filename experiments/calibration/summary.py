"""What a calibration says: a table, a result file, and a partial configuration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import yaml
from rich.table import Table

from experiments.calibration.free_numbers import NOT_DECIDED
from experiments.calibration.posterior import Observation, Posterior

# Width of an interval, relative to that of the prior, up to which records decide a number [A].
DECIDED = 0.5
# Below this plausibility the twin does not follow a record, whatever its numbers [A].
IMPLAUSIBLE = 1e-3


def verdict(observations: Sequence[Observation], posterior: Posterior) -> str:
    """Return "success" if the twin can follow every record, else "failure"."""
    followed = all(o.plausibility(posterior.shares) >= IMPLAUSIBLE for o in observations)
    return "success" if followed else "failure"


def number_rows(posterior: Posterior) -> list[dict[str, Any]]:
    """Return prior, median, interval and width of each number, in SI."""
    low, median, high = posterior.quantiles(0.025, 0.5, 0.975)
    return [
        {
            "path": number.path,
            "unit": number.unit,
            "prior": [number.low, number.high],
            "median": float(median[k]),
            "interval_95": [float(low[k]), float(high[k])],
            "point": float(posterior.point[k]),
            "width_of_prior": float(posterior.width[k]),
            "decided": bool(posterior.width[k] <= DECIDED),
        }
        for k, number in enumerate(posterior.numbers)
    ]


def record_rows(observations: Sequence[Observation], posterior: Posterior) -> list[dict[str, Any]]:
    """Return what was measured in each test, and how well the twin follows."""
    return [
        {
            "files": [record.name for record in o.records],
            "test": o.records[0].test.name,
            **o.records[0].options,
            "vacuum_Pa": o.records[0].vacuum,
            "noise_N": [record.noise for record in o.records],
            "measured": dict(zip(o.names, o.forces.tolist(), strict=True)),
            "emulator_error": dict(zip(o.names, o.emulator.relative_error.tolist(), strict=True)),
            "plausibility": o.plausibility(posterior.shares),
        }
        for o in observations
    ]


def result(observations: Sequence[Observation], posterior: Posterior) -> dict[str, Any]:
    """Return the content of ``result.json``, apart from how it was called."""
    return {
        "verdict": verdict(observations, posterior),
        "numbers": number_rows(posterior),
        "correlation": np.corrcoef(posterior.shares.T).tolist(),
        "records": record_rows(observations, posterior),
        "not_decided_by_these_tests": dict(NOT_DECIDED),
        "effective_draws": posterior.effective,
    }


def number_table(posterior: Posterior) -> Table:
    """Return one line per number."""
    table = Table(title="Posterior", title_justify="left")
    for name in ("number", "prior", "median", "95 % interval", "of the prior's width", ""):
        table.add_column(name, justify="left" if name in ("number", "") else "right")
    for row in number_rows(posterior):
        ends = [f"{a:.3g} to {b:.3g}" for a, b in (row["prior"], row["interval_95"])]
        table.add_row(
            f"{row['path']} {row['unit'] and '(' + row['unit'] + ')'}".rstrip(),
            ends[0],
            f"{row['median']:.3g}",
            ends[1],
            f"{row['width_of_prior']:.0%}",
            "" if row["decided"] else "not decided",
        )
    return table


def record_table(observations: Sequence[Observation], posterior: Posterior) -> Table:
    """Return one line per test."""
    table = Table(title="Records", title_justify="left")
    for name in ("test", "records", "noise [N]", "emulator's error", "plausibility", ""):
        table.add_column(name, justify="left" if name in ("test", "") else "right")
    for o in observations:
        plausible = o.plausibility(posterior.shares)
        table.add_row(
            o.records[0].test.name,
            str(len(o.records)),
            f"{max(record.noise for record in o.records):.3f}",
            f"{o.emulator.relative_error.mean():.1%}",
            f"{plausible:.2g}",
            "" if plausible >= IMPLAUSIBLE else "the twin cannot follow",
        )
    return table


def configuration(posterior: Posterior) -> str:
    """Return a partial configuration with the number's values that go together."""
    tree: dict[str, dict[str, dict[str, str]]] = {}
    for row in number_rows(posterior):
        section, part, name = row["path"].split(".")
        low, high = row["interval_95"]
        said = "" if row["decided"] else "; hardly decided by the records"
        value = yaml.safe_dump(float(f"{row['point']:.4g}")).splitlines()[0]
        text = f"{value}  # {low:.3g} to {high:.3g} {row['unit']}".rstrip() + said
        tree.setdefault(section, {}).setdefault(part, {})[name] = text
    lines = ["# By experiments.calibrate_jig: values that go together, with 95 % intervals."]
    for section, parts in tree.items():
        lines.append(f"{section}:")
        for part, entries in parts.items():
            lines += [f"  {part}:", *(f"    {name}: {text}" for name, text in entries.items())]
    return "\n".join(lines) + "\n"
