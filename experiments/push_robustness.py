"""Robustness of the push outcomes, to the free parameters and to the numerics.

    python -m experiments.push_robustness --samples 20 --workers 2 --out out/robustness
    python -m experiments.push_robustness --samples 0 --one-by-one
    python -m experiments.push_robustness --samples 10 --spread 0.3 --case plate/P1
    python -m experiments.push_robustness --samples 0 --numerics --controls
    python -m experiments.push_robustness --samples 0 --measurable

Parameters that the paper does not give are set once, for all cases and both parts, in the sections
``push``, ``placement`` and ``jig`` of the configuration. One follows from a measured number, the
mean displacement of the paper's successes, 78.2 mm: a jig that follows the hand until its abrupt
stop coasts on by v^2 / (2 mu g), so that v = sqrt(2 mu g (78.2 mm - stroke + gap)).

Every variant runs one trial of each case with the same disturbance, so that only the variant
differs.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.configuration.config import CellConfig
from cell.configuration.sections import entries
from cell.errors import RunFailure
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Row
from experiments.cli.common import BadUsage, Common, check_counts
from experiments.cli.ending import exit_code
from experiments.paper.case_plots import PAPER_MEANS
from experiments.paper.cases import cases_of
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.provenance import versions

# Paths in the configuration; the source of each setting states its plausible range.
PARAMETERS = (
    "push.jig_mass",
    "push.base_friction",
    "push.base_stiffness",
    "push.speed",
    "push.acceleration",
    "push.start_gap",
    "push.fingertip_height",
    "push.palm_height",
    "placement.press_force",
    "jig.vacuum.pressure",
    "jig.soil.membrane_modulus",
    "jig.soil.friction_angle",
    "jig.jammed.friction",
    "jig.jammed.modulus",
    "jig.suction.strength",
)
AS_CONFIGURED = "as configured"
GRAVITY = 9.81  # [m/s2]
NUMERICS = {
    "half the time step": {"simulation.time_step": 5e-4},
    "finer bed mesh": {"jig.bag.cell": 0.001, "jig.jammed.mesh_size": 0.0035},
    "approximation similar": {"simulation.contact_approximation": "similar"},
    "approximation sap": {"simulation.contact_approximation": "sap"},
}
# What an experimenter could measure, and the values registered with the rule of the push, but for
# the stiffness (docs/physics/push_experiment.md), each for one path in the configuration.
MEASURABLE: Mapping[str, tuple[float, ...]] = {
    "push.jig_mass": (1.0, 2.5),
    "push.base_friction": (0.3, 0.6),
    "push.base_stiffness": (1e6,),
    "push.fingertip_height": (0.001, 0.005, 0.010),
    "push.palm_height": (0.030, 0.089),
    "placement.press_force": (16.0, 24.0),
    "jig.suction.strength": (0.0, 6e3),
    "jig.jammed.strength": (0.7, 1.3),
    "push.speed": (0.1, 0.2),
}
CONTROLS = {
    "no suction": {"jig.suction.enabled": False},
    "30 kPa": {"jig.vacuum.pressure": 30e3},
    "left soft": {"jig.vacuum.pressure": 0.0},
}
Changes = Mapping[str, Any]  # Path in the configuration -> value.


@dataclass(frozen=True)
class RobustnessOptions:
    """Options of the script."""

    samples: int = 20
    """Number of joint samples, with all parameters drawn at once."""

    spread: float = 0.10
    """Largest relative change of a parameter."""

    case: Annotated[str | None, arg(metavar="motor/P2/a")] = None
    """A case, or a part or posture for all of its cases. Default: all nine."""

    one_by_one: bool = False
    """Also change every parameter alone, by the spread up and down."""

    numerics: bool = False
    """Also halve the time step, refine the bed's mesh, and take other contact approximations."""

    controls: bool = False
    """Also push without suction, at 30 kPa, on the bed left soft, and on a flat rigid plate."""

    measurable: bool = False
    """Also change what can be measured on a real jig, each alone over its plausible range, and say
    which cases it decides."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Trials at a time. What is done already is not run again."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


@dataclass(frozen=True)
class Variant:
    """One variant of the configuration.

    Attributes:
        name: For the table.
        changes: Values by path that differ from the configuration.
    """

    name: str
    changes: Changes = field(default_factory=dict)


def value_at(config: CellConfig, path: str) -> float:
    """Return the number at a dotted path of the configuration."""
    value = config
    for name in path.split("."):
        value = getattr(value, name)
    return float(value)  # type: ignore[arg-type]


def scaled(config: CellConfig, factors: Mapping[str, float]) -> Changes:
    """Return numbers of the configuration multiplied by factors, clipped to their valid range."""
    infos = {entry.path: entry.info for entry in entries(config)}
    return {
        path: infos[path].nearest(value_at(config, path) * factor)
        for path, factor in factors.items()
    }


def coasting_speed(config: CellConfig) -> float:
    """Return the push speed that displaces the jig by the mean of the paper's successes [m/s]."""
    push = config.push
    coast = PAPER_MEANS["success"] - push.stroke + push.start_gap
    return float(np.sqrt(2 * push.base_friction * GRAVITY * coast))


def variants(options: RobustnessOptions, config: CellConfig) -> list[Variant]:
    """Return the variants to run: as configured, those of the options, and the joint samples."""
    rng = np.random.default_rng([options.common.seed, 7])
    found = [Variant(AS_CONFIGURED)]
    if options.numerics:
        found += [Variant(name, changes) for name, changes in NUMERICS.items()]
    if options.controls:
        found += [Variant(name, changes) for name, changes in CONTROLS.items()]
        found.append(Variant("flat rigid plate", {"workcell.fixture": "flat_plate"}))
    if options.one_by_one:
        for path in PARAMETERS:
            for change in (options.spread, -options.spread):
                found.append(Variant(f"{path} {change:+.0%}", scaled(config, {path: 1 + change})))
    if options.measurable:
        for path, values in MEASURABLE.items():
            found += [Variant(f"{path}={value:g}", {path: value}) for value in values]
    for k in range(options.samples):
        factors = 1 + rng.uniform(-options.spread, options.spread, len(PARAMETERS))
        changes = scaled(config, dict(zip(PARAMETERS, factors.tolist(), strict=True)))
        found.append(Variant(f"sample {k}", changes))
    return found


def config_of(options: RobustnessOptions, variant: Variant) -> CellConfig:
    """Return the configuration of a variant.

    Raises:
        InputError: A value is invalid.
    """
    changes = [f"{path}={value}" for path, value in variant.changes.items()]
    common = replace(options.common, overrides=(*options.common.overrides, *changes))
    return common.load_config()


def run_variants(
    options: RobustnessOptions, wanted: Sequence[Variant], out: Path, console: Console
) -> list[dict[str, Any]]:
    """Run one trial of every case with every variant, as a campaign; return a row per variant."""
    cases = [{"case": case.label} for case in cases_of("push", options.case)]
    seeds = [options.common.seed]
    by_variant = {
        variant.name: trials("push", cases, config=config_of(options, variant), seeds=seeds)
        for variant in wanted
    }
    planned = {trial.key: trial for own in by_variant.values() for trial in own}
    rows = run_campaign(
        list(planned.values()),
        out,
        workers=options.workers,
        about={"command": "push_robustness"},
        console=console,
        report=False,
    )
    ended = {row.key: row for row in rows}
    return [
        row_of(variant, [ended[trial.key] for trial in by_variant[variant.name]])
        for variant in wanted
    ]


def row_of(variant: Variant, rows: Sequence[Row]) -> dict[str, Any]:
    """Return the row of the result for a variant, from the trials of its cases.

    Raises:
        RunFailure: A trial came to no verdict.
    """
    for row in rows:
        if not row.done:
            raise RunFailure(f"{variant.name}, {row.options['case']}: {row.evidence}")
    return {
        "variant": variant.name,
        "changes": dict(variant.changes),
        "outcome": {row.options["case"]: row.verdict for row in rows},
        "displacement_m": {row.options["case"]: row.measured.get("displacement_m") for row in rows},
    }


def flips(row: Mapping[str, Any], base: Mapping[str, Any]) -> list[str]:
    """Return the cases whose outcome differs from that of the base, with their displacement."""
    return [
        f"{label} ({1e3 * (row['displacement_m'][label] or 0.0):.0f} mm)"
        for label, outcome in base["outcome"].items()
        if row["outcome"][label] != outcome
    ]


def decided_by(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Return the cases whose outcome each measurable quantity changes, by its path.

    Args:
        rows: Of the result, the first as configured.
    """
    decided: dict[str, list[str]] = {}
    for path, values in MEASURABLE.items():
        own = [row for row in rows if row["variant"] in {f"{path}={value:g}" for value in values}]
        if own:
            decided[path] = [
                label
                for label, outcome in rows[0]["outcome"].items()
                if any(row["outcome"][label] != outcome for row in own)
            ]
    return decided


def robustness_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return a table of the number of joint samples in which each case keeps its outcome."""
    samples = [row for row in rows if row["variant"].startswith("sample")]
    table = Table("case", AS_CONFIGURED, "kept", title="Joint samples", title_justify="left")
    for label, outcome in rows[0]["outcome"].items():
        kept = sum(row["outcome"][label] == outcome for row in samples)
        table.add_row(label, outcome, f"{kept} of {len(samples)}")
    return table


def displacement_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return a table of the displacements of the jig [mm]; flipped outcomes are marked with *."""
    labels = list(rows[0]["outcome"])
    table = Table("variant", *labels, title=escape("Moved [mm]"), title_justify="left")
    for row in rows:
        moved = [f"{1e3 * (row['displacement_m'][label] or 0.0):.0f}" for label in labels]
        marks = [
            "" if row["outcome"][label] == rows[0]["outcome"][label] else "*" for label in labels
        ]
        table.add_row(row["variant"], *map("".join, zip(moved, marks, strict=True)))
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(
        RobustnessOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("push_robustness", lambda: run(options))


def run(options: RobustnessOptions) -> int:
    """Run what is missing of the variants, write ``result.json``, print the tables; return 0.

    Raises:
        InputError: An option or a value is invalid.
    """
    config = options.common.load_config()
    check_counts(options, "samples", least=0)
    if not 0 < options.spread < 1:
        raise BadUsage(f"--spread must be between 0 and 1, not {options.spread:g}.")
    check_counts(options, "workers")
    cases_of("push", options.case)
    console = Console(quiet=options.common.quiet, highlight=False)
    infos = {entry.path: entry.info for entry in entries(config)}
    for path in PARAMETERS:
        info = infos[path]
        text = f"{path} = {value_at(config, path):g} {info.unit}"
        console.print(f"{text.rstrip()}. {info.source}", markup=False)
    speed = coasting_speed(config)
    console.print(f"Speed for the paper's 78.2 mm: {speed:.3f} m/s", markup=False)
    wanted = variants(options, config)
    for variant in wanted:
        config_of(options, variant)  # Invalid values are refused before hours of computation.
    with output_folder(Path(options.common.out)) as out:
        rows = run_variants(options, wanted, out, console)
        result = {"command": "push_robustness", "seed": options.common.seed, "rows": rows}
        result["decided_by"] = decided_by(rows)
        write_json(out / "result.json", result | {"versions": versions()})
    for row in rows[1:]:
        flipped = ", ".join(flips(row, rows[0])) or "none"
        console.print(f"{row['variant']}: flips {flipped}", markup=False)
    console.print(displacement_table(rows))
    for path, labels in decided_by(rows).items():
        console.print(f"{path} decides {', '.join(labels) or 'none'}", markup=False)
    if options.samples:
        console.print(robustness_table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
