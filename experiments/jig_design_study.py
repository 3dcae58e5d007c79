"""What the jig's design decides: Sobol indices of holding, imprint and success.

    python -m experiments.jig_design_study --case motor/P2/a --samples 64 --workers 2
    python -m experiments.jig_design_study --sample radius=0.05:0.07 --sample push.speed=0.2:0.3

Bag radius, friction of the beads, membrane, vacuum and press force vary at once. A trial places a
part with the rig, measures what holds it, and pushes it. The indices say which share of the
variance of an outcome is due to each parameter, alone and with its interactions, over these ranges.
Run again, the study goes on where it was stopped.

N samples of d parameters take N (d + 2) trials of 12 to 20 CPU seconds.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape as rich_escape
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, UseAppendAction, arg

from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import parse_sample, trials
from experiments.campaigns.summary import rate_of
from experiments.campaigns.trial import Row
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.paper.cases import case_named
from experiments.reporting.html_page import Picture, figures, page, pairs, section, table
from experiments.reporting.output import output_folder, write_json, write_text
from experiments.reporting.provenance import finite, versions
from experiments.studies.figures import bars, over_parameters
from experiments.studies.jig_design import design
from experiments.studies.sensitivity import Indices, pick_freeze, sobol

RANGES = {
    "radius": (0.050, 0.070),  # [m] [A] The paper's 60 mm, and a sixth to both sides.
    "jig.soil.friction_angle": (0.38, 0.61),  # [rad] [R] Glass beads 22 deg; [A] angular sand 35.
    "jig.soil.membrane_modulus": (50.0, 300.0),  # [N/m] [D] 0.15 MPa of silicone, 0.3 to 2 mm.
    "jig.vacuum.pressure": (30e3, 90e3),  # [Pa] [A] A diaphragm pump's to the paper's.
    "placement.press_force": (10.0, 30.0),  # [N] [A] Plausible 15 to 30, and less.
}
OUTCOMES = {
    "holding_N": "holding sideways [N]",
    "lifting_N": "holding upwards [N]",
    "depth_m": "depth of the imprint [m]",
    "placed": "success of placing",
    "pushed": "success of the push",
}
RATES = ("placed", "pushed")  # 0 or 1.


@dataclass(frozen=True)
class DesignOptions:
    """Options of the script."""

    case: Annotated[str, arg(metavar="motor/P2/a")] = "motor/P2/a"
    """Part, posture and push."""

    samples: Annotated[int, arg(metavar="N")] = 64
    """Base samples, a power of 2. Intervals of +-0.1 take 64 or more."""

    sample: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="KEY=LO:HI")] = ()
    """Another range of a parameter, or a further setting. Repeatable."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Trials at a time. What is done already is not run again."""

    executor: Annotated[str, arg(metavar="local|dask://HOST:PORT")] = "local"
    """Where trials run."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


def run(options: DesignOptions) -> int:
    """Run what is missing of the study and write its files.

    Returns:
        0, or 3 if a trial came to no verdict: then there are no indices.

    Raises:
        InputError: An option is invalid.
    """
    check_counts(options, "workers")
    case_named("push", options.case)
    config, seed = options.common.load_config(), options.common.seed
    ranges = RANGES | parse_sample(options.sample)
    points = [{"case": options.case, **p} for p in pick_freeze(ranges, options.samples, seed)]
    wanted = [trials(design, [point], config=config, seeds=[seed])[0] for point in points]
    console = Console(quiet=options.common.quiet, highlight=False)
    about = {"command": "jig_design_study", "case": options.case, "ranges": ranges, "seed": seed}
    with output_folder(options.common.out) as out:
        rows = run_campaign(
            wanted,
            out,
            workers=options.workers,
            executor=options.executor,
            about=about,
            console=console,
        )
        if bad := [row for row in rows if not row.done]:
            console.print(f"{len(bad)} trials came to no verdict: {bad[0].evidence}", markup=False)
            return 3
        facts = about | {"samples": options.samples, "trials": len(rows), **rate_of(rows)}
        facts |= {"cpu_seconds": sum(row.cpu_seconds for row in rows)}
        facts |= {"config": finite(config.to_dict()), "versions": versions()}
        found = {name: indices_of(rows, name, len(ranges), seed) for name in OUTCOMES}
        write_study(out, facts, rows, list(ranges), found)
    for name, indices in found.items():
        if isinstance(indices, str):
            console.print(f"{OUTCOMES[name]}: no indices, {indices}.", markup=False)
        else:
            console.print(index_table(name, list(ranges), indices))
    return 0


def indices_of(rows: Sequence[Row], outcome: str, parameters: int, seed: int) -> Indices | str:
    """Return the indices of an outcome, or why there are none.

    Args:
        rows: In the order of `pick_freeze`.
        outcome: Name of the quantity.
        parameters: Their number.
        seed: Of the resampling.
    """
    values = [row.measured.get(outcome) for row in rows]
    if missing := sum(value is None for value in values):
        return f"{missing} trials have no value"
    known = [value for value in values if value is not None]
    return sobol(known, parameters, seed) or "it is the same at all base points"


def index_rows(
    outcome: str, parameters: Sequence[str], indices: Indices | str
) -> list[dict[str, Any]]:
    """Return one line per parameter: the indices of an outcome with their intervals."""
    if isinstance(indices, str):
        return [{"outcome": outcome, "parameter": "", "remark": indices}]
    return [
        {
            "outcome": outcome,
            "parameter": name,
            "first": float(indices.first[k]),
            "first_low": float(indices.first_interval[k, 0]),
            "first_high": float(indices.first_interval[k, 1]),
            "total": float(indices.total[k]),
            "total_low": float(indices.total_interval[k, 0]),
            "total_high": float(indices.total_interval[k, 1]),
        }
        for k, name in enumerate(parameters)
    ]


def write_study(
    out: Path,
    facts: Mapping[str, Any],
    rows: Sequence[Row],
    parameters: Sequence[str],
    found: Mapping[str, Indices | str],
) -> None:
    """Write ``study.json``, ``study.csv`` and ``study.html``."""
    lines = [line for name, each in found.items() for line in index_rows(name, parameters, each)]
    write_json(out / "study.json", {**facts, "indices": lines})
    text = io.StringIO(newline="")
    heads = dict.fromkeys([name for line in lines for name in line])
    writer = csv.DictWriter(text, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    write_text(out / "study.csv", text.getvalue())
    parts = [
        f"<h1>Design of the jig: {escape(str(facts['case']))}</h1>",
        f"<p>{escape((__doc__ or '').split(chr(10) * 2)[2])}</p>",
        pairs({k: facts[k] for k in ("samples", "trials", "success_rate", "success_interval")}),
    ]
    for name, indices in found.items():
        pictures = list(_pictures(name, rows, parameters, indices))
        body = figures(pictures, wide=True) + table(
            index_rows(name, parameters, indices), ["parameter", "first", "total", "remark"]
        )
        parts.append(section(OUTCOMES[name], body))
    ranges = {name: list(ends) for name, ends in facts["ranges"].items()}
    parts.append(section("Ranges", pairs(ranges)))
    parts.append(section("Set-up", pairs(facts["versions"])))
    parts.append('<p>The trials: <a href="report.html">report.html</a>.</p>')
    write_text(out / "study.html", page("Design of the jig", "\n".join(parts)))


def _pictures(
    outcome: str, rows: Sequence[Row], parameters: Sequence[str], indices: Indices | str
) -> list[Picture]:
    if isinstance(indices, str):
        return []
    shares = {
        "alone": (indices.first, indices.first_interval),
        "with interactions": (indices.total, indices.total_interval),
    }
    values = {
        name: np.array([row.varied[name] for row in rows], dtype=float) for name in parameters
    }
    outcomes = np.array([row.measured[outcome] for row in rows], dtype=float)
    label = OUTCOMES[outcome]
    return [
        (
            "Sobol indices with 95 % intervals",
            bars(list(parameters), shares, f"share of the variance of {label}"),
        ),
        (
            "Every trial, and means over sixths of the trials with 95 % intervals",
            over_parameters(values, outcomes, label, outcome in RATES),
        ),
    ]


def index_table(outcome: str, parameters: Sequence[str], indices: Indices) -> Table:
    """Return the indices of an outcome for a terminal."""
    title = rich_escape(OUTCOMES[outcome])
    shown = Table("parameter", "alone", "with interactions", title=title, title_justify="left")
    for line in index_rows(outcome, parameters, indices):
        both = [
            f"{line[kind]:.2f} ({line[kind + '_low']:.2f} to {line[kind + '_high']:.2f})"
            for kind in ("first", "total")
        ]
        shown.add_row(line["parameter"], *both)
    return shown


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    options = tyro.cli(
        DesignOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("jig_design_study", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
