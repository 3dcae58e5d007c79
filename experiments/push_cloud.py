"""How robust the push outcomes are: every global parameter by ±10 %, alone and all together.

    python -m experiments.push_cloud --samples 20 --out out/cloud

What the paper does not give is set once, for all cases and both parts, in the configuration's
section ``push`` and in ``placement`` and ``jig``. One of these numbers follows from a measured one:
the mean displacement of the paper's successes, 78.2 mm. A jig that follows the hand until it stops
dead coasts on by v^2 / (2 mu g), so that v = sqrt(2 mu g (78.2 mm - stroke + gap)).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.config import CellConfig
from cell.errors import CellError
from cell.loading import load_product
from experiments.case_plots import PAPER_MEANS
from experiments.cases import run_cases
from experiments.cli import Common
from experiments.output import output_folder, write_json
from experiments.place_push import cases_of
from experiments.results import versions

# Path in the configuration -> its range in the sources, for the table; the cloud is ±10 %.
PARAMETERS = {
    "push.jig_mass": "1 to 3 kg [A]",
    "push.base_friction": "0.3 to 0.6 [A]",
    "push.speed": "0.22 to 0.28 m/s [D]",
    "push.acceleration": "any [A]",
    "push.height_fraction": "0.5 to 0.7 [A]",
    "placement.press_force": "15 to 30 N [A]",
    "jig.vacuum.pressure": "about 90 kPa [S]",
    "jig.soil.membrane_modulus": "100 to 150 N/m [R]",
    "jig.soil.friction_angle": "22 to 28 deg [R]",
    "jig.jammed.friction": "0.6 to 1.3 [R]",
    "jig.jammed.pressure_gradient": "1e8 to 1e9 Pa/m [A]",
}
SPREAD = 0.10
GRAVITY = 9.81  # [m/s2]
Factors = Mapping[str, float]


@dataclass(frozen=True)
class Options:
    """What to run."""

    samples: int = 20
    """Joint samples, all parameters drawn at once."""

    case: Annotated[str | None, arg(metavar="motor/P2/a")] = None
    """A case, or a part or posture for all of its cases. Default: all nine."""

    one_by_one: bool = False
    """Also change every parameter alone, by +10 % and by -10 %."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


def value_at(config: CellConfig, path: str) -> float:
    """Return the number at a dotted path of the configuration."""
    value = config
    for name in path.split("."):
        value = getattr(value, name)
    return float(value)  # type: ignore[arg-type]


def scaled(config: CellConfig, common: Common, factors: Factors) -> CellConfig:
    """Return the configuration with some numbers multiplied."""
    changes = [f"{path}={value_at(config, path) * factor!r}" for path, factor in factors.items()]
    return CellConfig.load(common.config, [*common.overrides, *changes])


def coasting_speed(config: CellConfig) -> float:
    """Return the push speed that takes the jig as far as the paper's mean success [m/s]."""
    push = config.push
    coast = PAPER_MEANS["success"] - push.stroke + push.start_gap
    return float(np.sqrt(2 * push.base_friction * GRAVITY * coast))


def variants(options: Options) -> list[tuple[str, Factors]]:
    """Return what to run: as it is, each parameter alone if wanted, and the joint cloud."""
    rng = np.random.default_rng([options.common.seed, 7])
    found: list[tuple[str, Factors]] = [("as configured", {})]
    if options.one_by_one:
        for path in PARAMETERS:
            found += [(f"{path} {sign:+.0%}", {path: 1 + sign}) for sign in (SPREAD, -SPREAD)]
    for k in range(options.samples):
        factors = 1 + rng.uniform(-SPREAD, SPREAD, len(PARAMETERS))
        found.append((f"sample {k}", dict(zip(PARAMETERS, factors.tolist(), strict=True))))
    return found


def run_cloud(options: Options, config: CellConfig, console: Console) -> list[dict]:
    """Run one trial of every case for every variant; return one row each."""
    rows = []
    for name, factors in variants(options):
        done = run_cases(
            cases_of("push", options.case),
            product=load_product("motor_unit"),
            config=scaled(config, options.common, factors),
            bed="soft",
            trials=1,
            seed=options.common.seed,
        )
        outcomes = {result.case.label: result for result, _ in done}
        row = {
            "variant": name,
            "factors": dict(factors),
            "outcome": {label: result.outcome for label, result in outcomes.items()},
            "displacement_m": {
                label: result.means().get("displacement_m") for label, result in outcomes.items()
            },
        }
        rows.append(row)
        flips = [label for label, was in rows[0]["outcome"].items() if row["outcome"][label] != was]
        console.print(f"{name}: flips {', '.join(flips) or 'none'}", markup=False)
    return rows


def cloud_table(rows: Sequence[dict]) -> Table:
    """Return in how many samples each case keeps its outcome."""
    table = Table(title="Joint cloud of ±10 %", title_justify="left")
    for heading in ("case", "outcome as configured", "kept in"):
        table.add_column(heading)
    samples = [row for row in rows if row["variant"].startswith("sample")]
    for label, outcome in rows[0]["outcome"].items():
        kept = sum(row["outcome"][label] == outcome for row in samples)
        table.add_row(label, outcome, f"{kept} of {len(samples)}")
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    options = tyro.cli(Options, args=arguments, description=__doc__, config=(FlagCreatePairsOff,))
    try:
        return _run(options)
    except CellError as error:
        print(f"push_cloud: {error}", file=sys.stderr)
        return 2


def _run(options: Options) -> int:
    config = options.common.load_config()
    if options.samples < 1:
        raise CellError(f"--samples must be at least 1, not {options.samples}.")
    cases_of("push", options.case)
    console = Console(quiet=options.common.quiet, highlight=False)
    for path, source in PARAMETERS.items():
        console.print(f"{path} = {value_at(config, path):g} (range {source})", markup=False)
    speed = coasting_speed(config)
    console.print(f"Speed for the paper's 78.2 mm: {speed:.3f} m/s", markup=False)
    with output_folder(Path(options.common.out)) as out:
        rows = run_cloud(options, config, console)
        result = {"command": "push_cloud", "seed": options.common.seed, "rows": rows}
        write_json(out / "result.json", result | {"versions": versions()})
    console.print(cloud_table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
