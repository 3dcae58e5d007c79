"""How large an error of seen poses each step of an assembly bears, and which one it bears least.

    python -m experiments.pose_error_study motor_unit --seeds 10 --workers 2 --out out/pose_errors
    python -m experiments.pose_error_study idler --step "insert arm" --level lateral=0.5,1,2

The assembly is run once without errors. Then each step is tried from its state in that run, with
an error of one size in every pose that is seen: sideways, in height, in yaw or in tilt, in
directions that differ from look to look and with the seed. The seeds are the same at all sizes. Its
tolerance is the size at which the success rate falls below 90 %; the component with the least
margin over the error that is expected of a camera dominates. Run again, the study goes on where it
was stopped.

A trial takes 6 to 20 CPU seconds, most of it the step.
"""

from __future__ import annotations

import csv
import io
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, UseAppendAction, arg

from cell.errors import InputError, RunFailure, UnknownName
from cell.products.loading import require_product_file
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import parse_grid, trials
from experiments.campaigns.trial import Row, Task, Trial
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.reporting.html_page import figures, page, pairs, section, table
from experiments.reporting.output import output_folder, write_json, write_text
from experiments.reporting.provenance import finite, versions
from experiments.reporting.statistics import wilson
from experiments.studies.figures import rates
from experiments.studies.pose_errors import COMPONENTS, planned_steps, with_error, without_error
from experiments.studies.tolerance import Tolerance, tolerance

GOAL = 0.9
UNITS = {"lateral": ("mm", 1e-3), "height": ("mm", 1e-3), "yaw": ("deg", np.pi / 180)}
UNITS["tilt"] = UNITS["yaw"]
LEVELS = {
    "lateral": [0.1, 0.3, 1.0, 3.0, 10.0],
    "height": [0.1, 0.3, 1.0, 3.0, 10.0],
    "yaw": [0.3, 1.0, 3.0, 10.0, 30.0],
    "tilt": [0.3, 1.0, 3.0, 10.0, 30.0],
}
EXPECTED = {"lateral": 0.07, "height": 0.07, "yaw": 0.23, "tilt": 0.72}
"""[M] Largest 90 % error of `evaluate_pose` over the postures, in the units above."""


@dataclass(frozen=True)
class ErrorOptions:
    """Options of the script."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")] = "motor_unit"
    """A name in models/products, or a YAML file."""

    order: Annotated[str, arg(metavar="A,B,C")] = ""
    """Assembly order: parts or groups, separated by commas. Default: the product's first one."""

    step: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = ()
    """A step to try. Repeatable; default: all."""

    level: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="COMPONENT=A,B,C")] = ()
    """Sizes of lateral or height [mm], yaw or tilt [deg]. Repeatable; if given, only these
    components are tried."""

    expected: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="COMPONENT=A")] = ()
    """Error that is expected of a component, in the same unit. Repeatable."""

    seeds: int = 10
    """Trials of each step at each size, with consecutive seeds from --seed."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Trials at a time. What is done already is not run again."""

    executor: Annotated[str, arg(metavar="local|dask://HOST:PORT")] = "local"
    """Where trials run."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


@dataclass(frozen=True)
class Curve:
    """One step and one component.

    Attributes:
        step: Name of the step.
        component: Of the error.
        sizes: (n,) in mm or deg, rising.
        successes: (n,) at each size.
        trials: (n,) at each size.
        phases: In which trials failed, the most frequent first.
    """

    step: str
    component: str
    sizes: np.ndarray
    successes: np.ndarray
    trials: np.ndarray
    phases: tuple[str, ...]

    @property
    def tolerance(self) -> Tolerance:
        """Size at which the success rate falls below `GOAL`."""
        return tolerance(list(self.sizes), list(self.successes), list(self.trials), GOAL)


def run(options: ErrorOptions) -> int:
    """Run what is missing of the study and write its files.

    Returns:
        0, or 3 if a trial came to no verdict.

    Raises:
        InputError: An option is invalid.
        RunFailure: The assembly fails without errors.
    """
    check_counts(options, "seeds", "workers")
    require_product_file(options.product)
    levels, expected = levels_of(options.level), EXPECTED | expected_of(options.expected)
    config, seed = options.common.load_config(), options.common.seed
    _, todo = planned_steps(Task(options.product, config, seed, Path()), options.order)
    names = [step.name for step in todo]
    for name in options.step:
        if name not in names:
            raise UnknownName("step", name, names)
    given: dict[str, Any] = {"product": options.product, "config": config}
    console = Console(quiet=options.common.quiet, highlight=False)
    about = {"command": "pose_error_study", "product": options.product, "seeds": options.seeds}
    with output_folder(options.common.out) as out:

        def rows_of(wanted: Sequence[Trial]) -> list[Row]:
            return run_campaign(
                wanted,
                out,
                workers=options.workers,
                executor=options.executor,
                about=about,
                console=console,
            )

        (first,) = trials(without_error, [{"order": options.order}], seeds=[seed], **given)
        (start,) = rows_of([first])
        if start.verdict != "success":
            raise RunFailure(f"Without errors, '{start.phase}' fails: {start.evidence}")
        points = [
            {"order": options.order, "start": first.key, "step": k, "component": c,
             "size": UNITS[c][1] * size}
            for k, name in enumerate(names)
            if not options.step or name in options.step
            for c, sizes in levels.items()
            for size in sizes
        ]  # fmt: skip
        seeds = range(seed, seed + options.seeds)
        rows = rows_of(trials(with_error, points, seeds=seeds, **given))
        if bad := [row for row in rows if not row.done]:
            console.print(f"{len(bad)} trials came to no verdict: {bad[0].evidence}", markup=False)
            return 3
        found = list(curves(rows, names, levels))
        facts = about | {"order": options.order, "trials": len(rows), "goal": GOAL}
        facts |= {"cpu_seconds": sum(row.cpu_seconds for row in rows), "expected": expected}
        facts |= {"config": finite(config.to_dict()), "versions": versions()}
        write_study(out, facts, found, expected)
    console.print(tolerance_table(found, expected))
    return 0


def levels_of(texts: Sequence[str]) -> dict[str, list[float]]:
    """Return the sizes by component of texts "lateral=0.1,1", rising; those of `LEVELS` for none.

    Raises:
        InputError: A component is unknown, or a size is no positive number.
    """
    if not texts:
        return LEVELS
    found = {}
    for component, sizes in parse_grid(texts).items():
        if component not in COMPONENTS:
            raise UnknownName("component of a pose error", component, COMPONENTS)
        if any(isinstance(s, bool) or not isinstance(s, int | float) or s <= 0 for s in sizes):
            raise InputError(f"--level {component}: sizes are positive numbers, not {sizes}.")
        found[component] = sorted({float(size) for size in sizes})
    return found


def expected_of(texts: Sequence[str]) -> dict[str, float]:
    """Return the expected errors by component of texts "lateral=0.5"."""
    found = levels_of(texts) if texts else {}
    return {component: sizes[-1] for component, sizes in found.items()}


def curves(
    rows: Sequence[Row], steps: Sequence[str], levels: Mapping[str, Sequence[float]]
) -> Iterator[Curve]:
    """Yield the success of each step under each component of error that was tried.

    Args:
        rows: Of trials of `with_error`.
        steps: Names of all steps.
        levels: Sizes by component, rising.
    """
    for number, step in enumerate(steps):
        for component, sizes in levels.items():
            own = [
                r for r in rows if (r.varied["step"], r.varied["component"]) == (number, component)
            ]
            if not own:
                continue
            at = [[r for r in own if r.varied["size"] == UNITS[component][1] * s] for s in sizes]
            failed = Counter(row.phase for row in own if row.verdict != "success")
            yield Curve(
                step,
                component,
                np.array(sizes),
                np.array([sum(row.verdict == "success" for row in group) for group in at]),
                np.array([len(group) for group in at]),
                tuple(phase for phase, _ in failed.most_common()),
            )


def tolerance_rows(
    found: Sequence[Curve], expected: Mapping[str, float]
) -> Iterator[dict[str, Any]]:
    """Yield a line per step and component; what dominates a step has its least margin."""
    margins = [(c, c.tolerance.size / expected[c.component]) for c in found]
    least = {c.step: min(m for other, m in margins if other.step == c.step) for c in found}
    for curve, margin in margins:
        unit, reached = UNITS[curve.component][0], curve.tolerance
        all_pass = reached.beyond and margin == least[curve.step]
        yield {
            "step": curve.step,
            "component": curve.component,
            "tolerance": f"{reached.sign}{reached.size:.3g} {unit}",
            "expected": f"{expected[curve.component]:g} {unit}",
            "margin": f"{reached.sign}{margin:.3g}",
            "dominates": "" if margin > least[curve.step] or all_pass else "dominates",
            "fails in": ", ".join(curve.phases[:2]),
        }


def level_rows(found: Sequence[Curve]) -> Iterator[dict[str, Any]]:
    """Yield a line per step, component and size, with Wilson's 95 % interval."""
    for curve in found:
        lines = zip(curve.sizes, curve.successes, curve.trials, strict=True)
        for size, successes, count in lines:
            low, high = wilson(int(successes), int(count))
            yield {
                "step": curve.step,
                "component": curve.component,
                "size": float(size),
                "unit": UNITS[curve.component][0],
                "successes": int(successes),
                "trials": int(count),
                "rate": float(successes / count),
                "low": low,
                "high": high,
            }


def write_study(
    out: Path, facts: Mapping[str, Any], found: Sequence[Curve], expected: Mapping[str, float]
) -> None:
    """Write ``study.json``, ``study.csv`` and ``study.html``."""
    levels, tolerances = list(level_rows(found)), list(tolerance_rows(found, expected))
    write_json(out / "study.json", {**facts, "tolerances": tolerances, "levels": levels})
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(levels[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(levels)
    write_text(out / "study.csv", text.getvalue())
    title = f"Pose errors: {facts['product']}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{escape((__doc__ or '').split(chr(10) * 2)[2])}</p>",
        pairs({name: facts[name] for name in ("trials", "seeds", "goal")}),
        section("Tolerances", table(tolerances, list(tolerances[0]))),
    ]
    for step in dict.fromkeys(curve.step for curve in found):
        pictures = []
        for unit in ("mm", "deg"):
            own = [c for c in found if c.step == step and UNITS[c.component][0] == unit]
            if own:
                lines = {c.component: (c.sizes, c.successes, c.trials) for c in own}
                picture = rates(lines, f"error of seen poses [{unit}]", GOAL)
                pictures.append(("Success rate with Wilson's 95 % intervals", picture))
        parts.append(section(escape(step), figures(pictures)))
    parts.append(section("Set-up", pairs(facts["versions"])))
    parts.append('<p>The trials: <a href="report.html">report.html</a>.</p>')
    write_text(out / "study.html", page(title, "\n".join(parts)))


def tolerance_table(found: Sequence[Curve], expected: Mapping[str, float]) -> Table:
    """Return the tolerances for a terminal."""
    rows = list(tolerance_rows(found, expected))
    shown = Table(*rows[0], title=f"Success rate of {GOAL:.0%} up to", title_justify="left")
    for row in rows:
        shown.add_row(*row.values())
    return shown


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    options = tyro.cli(
        ErrorOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("pose_error_study", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
