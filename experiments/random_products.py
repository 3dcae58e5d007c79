"""Products drawn at random, from CAD to the last screw: how many are assembled, what stops others.

    python -m experiments.random_products --count 20 --workers 2 --out out/random

Each is drawn, drafted by ``init`` and checked; no file is touched in between. What `check` has
nothing against is assembled, as a campaign: the same command again goes on where it was stopped.
`experiments.product.random_drawing` says what is drawn. The products of a seed are the same on
every machine. ``random_products.json`` holds the table.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import OmitArgPrefixes, arg

from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Row
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.product.drafting import Draft, drafted
from experiments.product.random_drawing import Drawing, draw
from experiments.reporting.output import output_folder, write_json

TABLE = "random_products.json"
ASSEMBLED, REFUSED, FAILED, CHECKED = "assembled", "refused", "failed", "checked"
GOAL = 0.7  # [A] Share that is to be assembled.


@dataclass(frozen=True)
class Line:
    """What became of one product.

    Attributes:
        number: Seeds its drawing and its run.
        drawn: What it is.
        parts: How many it has.
        outcome: "assembled"; "refused" by init or check, before anything was simulated; "failed";
            "checked", if no more was asked for.
        reason: Of what stopped it.
        seconds: CPU time of init, check and assembly [s].
    """

    number: int
    drawn: str
    parts: int
    outcome: str
    reason: str
    seconds: tuple[float, float, float]

    @staticmethod
    def of(number: int, drawing: Drawing, draft: Draft, row: Row | None) -> Line:
        """Return the line of a product; without a row, of one that was not assembled."""
        outcome, reason = CHECKED, ""
        if draft.against:
            outcome, reason = REFUSED, "; ".join(draft.against)
        elif row is not None and row.verdict == "success":
            outcome = ASSEMBLED
        elif row is not None:
            outcome, reason = FAILED, f"{row.phase}: {row.evidence}"
        seconds = (*draft.seconds, row.cpu_seconds if row else 0.0)
        return Line(number, ", ".join(drawing.text), len(drawing.parts), outcome, reason, seconds)


@dataclass(frozen=True)
class RandomProducts:
    """Draw products, draft, check and assemble them, and say what became of each."""

    count: Annotated[int, arg(metavar="N")] = 20
    """How many."""

    first: int = 0
    """Number of the first; it seeds what is drawn."""

    only_check: bool = False
    """Simulate nothing."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Runs at a time. What is done already is not run again."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write the table; return 0 if seven of ten are assembled, else 1."""
        check_counts(self, "count", "workers")
        common, numbers = self.common, range(self.first, self.first + self.count)
        config, console = common.load_config(), Console(quiet=common.quiet, highlight=False)
        drawings = {number: draw(np.random.default_rng(number)) for number in numbers}
        with output_folder(common.out, TABLE) as out:
            drafts, wanted = {}, {}
            for number, drawing in drawings.items():
                folder = out / f"product_{number}"
                draft = drafts[number] = drafted(drawing.parts, folder, config, seed=number)
                said = "; ".join(draft.against) or "nothing against it"
                console.print(f"{number}: {', '.join(drawing.text)}: {said}", markup=False)
                if not draft.against and not self.only_check:
                    file, seeds = draft.file, [number]
                    (wanted[number],) = trials("assemble", product=file, config=config, seeds=seeds)
            todo = list(wanted.values())
            rows = run_campaign(todo, out, workers=self.workers, console=console)
            of_key = {row.key: row for row in rows}
            row_of = {number: of_key[trial.key] for number, trial in wanted.items()}
            lines = [Line.of(n, drawings[n], drafts[n], row_of.get(n)) for n in numbers]
            write_json(out / TABLE, {"products": [asdict(line) for line in lines]})
        console.print(_table(lines))
        good = sum(line.outcome == ASSEMBLED for line in lines)
        console.print(f"{good} of {len(lines)} assembled")
        return 0 if good >= GOAL * len(lines) else 1


def _table(lines: Sequence[Line]) -> Table:
    table = Table("no.", "drawn", "outcome", "CPU s: init, check, run", "reason")
    for line in lines:
        seconds = ", ".join(f"{s:.0f}" for s in line.seconds)
        table.add_row(str(line.number), line.drawn, line.outcome, seconds, line.reason)
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; return its exit code."""
    options = tyro.cli(RandomProducts, args=arguments, description=__doc__)
    return exit_code("random_products", options.run)


if __name__ == "__main__":
    sys.exit(main())
