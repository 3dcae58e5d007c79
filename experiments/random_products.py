"""Products drawn at random, from CAD to the last screw: how many are assembled, what stops others.

    python -m experiments.random_products --count 20 --out out/random

Each is drawn, drafted by ``init``, checked, and assembled if the check has nothing against it; no
file is touched in between. `experiments.product.random_drawing` says what is drawn. The products of
a seed are the same on every machine. ``random_products.json`` holds the table.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import OmitArgPrefixes

from cell.configuration.config import CellConfig
from cell.errors import CellError
from cell.products.loading import load_product
from experiments.assembly.assemble import run_job
from experiments.assembly.job import Job
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.product.check import find
from experiments.product.init import PRODUCT_FILE, Wanted, run_init
from experiments.product.random_drawing import draw, write_cad
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.result_file import RESULT
from planning.product_check.finding import Level

TABLE = "random_products.json"
ASSEMBLED, REFUSED, FAILED = "assembled", "refused", "failed"
GOAL = 0.7  # [A] Share that is to be assembled.


@dataclass(frozen=True)
class Trial:
    """What became of one product.

    Attributes:
        number: Seeds its drawing and its run.
        drawn: What it is.
        parts: How many it has.
        outcome: "assembled"; "refused" by init or check, before anything was simulated; "failed".
        reason: Of what stopped it.
        seconds: CPU time of init, check and assembly [s].
    """

    number: int
    drawn: str
    parts: int
    outcome: str
    reason: str
    seconds: tuple[float, float, float]


@dataclass(frozen=True)
class RandomProducts:
    """Draw products, draft, check and assemble them, and say what became of each."""

    count: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """How many."""

    first: int = 0
    """Number of the first; it seeds what is drawn."""

    only_check: bool = False
    """Simulate nothing."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write the table; return 0 if seven of ten are assembled, else 1."""
        check_counts(self, "count")
        config, trials = self.common.load_config(), []
        console = Console(quiet=self.common.quiet, highlight=False)
        with output_folder(self.common.out, TABLE) as out:
            for number in range(self.first, self.first + self.count):
                trials.append(_trial(number, out / f"product_{number}", config, self.only_check))
                last = trials[-1]
                console.print(f"{number}: {last.drawn}: {last.outcome} {last.reason}", markup=False)
                write_json(out / TABLE, {"trials": [asdict(trial) for trial in trials]})
        console.print(_table(trials))
        good = sum(trial.outcome == ASSEMBLED for trial in trials)
        console.print(f"{good} of {len(trials)} assembled")
        return 0 if good >= GOAL * len(trials) else 1


def _trial(number: int, folder: Path, config: CellConfig, only_check: bool) -> Trial:
    """Return what becomes of one product."""
    drawing = draw(np.random.default_rng(number))
    clock = [time.process_time()]

    def trial(outcome: str, reason: str = "") -> Trial:
        clock.append(time.process_time())
        init, check, run = [*np.diff(clock), 0.0, 0.0][:3]
        drawn, parts = ", ".join(drawing.text), len(drawing.parts)
        seconds = float(init), float(check), float(run)
        return Trial(number, drawn, parts, outcome, reason, seconds)

    own = folder / "own"
    try:
        source = write_cad(drawing.parts, folder / "cad")
        run_init(Wanted(source, units="mm"), own, config, quiet=True)
        clock.append(time.process_time())
        product = load_product(own / PRODUCT_FILE)
        found = find(product, None, config, number)
        against = [f"{f.subject}: {f.text}" for f in found if f.level is Level.FAILS]
        clock.append(time.process_time())
    except CellError as error:
        return trial(REFUSED, str(error))
    if against or only_check:
        return trial(REFUSED if against else "checked", "; ".join(against))
    run = folder / "run"
    run.mkdir(exist_ok=True)
    try:
        run_job(Job(product, None, config, number, run, quiet=True))
    except CellError as error:
        return trial(FAILED, str(error))
    reason = _reason(json.loads((run / RESULT).read_text()))
    return trial(FAILED if reason else ASSEMBLED, reason)


def _reason(result: dict) -> str:  # pyright: ignore[reportMissingTypeArgument]
    """Return why a run failed, in words; "" for one that did not."""
    if result["verdict"] == "success":
        return ""
    if result.get("failure"):
        return f"{result['failure']['phase']}: {result['failure']['evidence']}"
    step = next(step for step in result["steps"] if step["verdict"] != "success")
    limits = [
        f"{check['quantity']} = {check['value']:.3g} > {check['limit']:.3g}"
        if check["value"] is not None
        else f"{check['quantity']} not measured"
        for check in step["failed_checks"]
    ]
    return f"{step['name']}: {'; '.join(limits)}"


def _table(trials: Sequence[Trial]) -> Table:
    table = Table("no.", "drawn", "outcome", "CPU s: init, check, run", "reason")
    for trial in trials:
        seconds = ", ".join(f"{s:.0f}" for s in trial.seconds)
        table.add_row(str(trial.number), trial.drawn, trial.outcome, seconds, trial.reason)
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; return its exit code."""
    options = tyro.cli(RandomProducts, args=arguments, description=__doc__)
    return exit_code("random_products", options.run)


if __name__ == "__main__":
    sys.exit(main())
