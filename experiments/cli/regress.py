"""``soft-jig regress`` and its options."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, UseAppendAction, arg

from experiments.cli.common import BadUsage, Common, check_counts
from experiments.reporting.output import output_folder


@dataclass(frozen=True)
class Regress:
    """Run experiments with seed 0 and compare outcomes and metrics with the stored ones.

    Exit code 0: none drifts beyond its tolerance. 1: one does. 3: a trial came to no verdict.
    """

    suite: Literal["quick", "full"] = "quick"
    """quick: six cases, two minutes of CPU; full: every case, three trials each."""

    case: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="push/plate/P1/a")] = ()
    """Only this case, or those that begin so, such as push/plate. Repeatable."""

    baseline: Annotated[Path | None, arg(metavar="FILE")] = None
    """Stored metrics of your own, for its cases. Default: those of the suite, in the package."""

    update: bool = False
    """Store what comes out, and print what changes; other cases in the file stay."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Trials at a time. What is done already is not run again."""

    junit: Annotated[Path | None, arg(metavar="FILE")] = None
    """Also write JUnit's XML, a test case per case."""

    csv: Annotated[Path | None, arg(metavar="FILE")] = None
    """Also write a table of all metrics."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json``; return the exit code."""
        config = self.common.load_config()
        if self.common.seed != 0:
            raise BadUsage("The stored metrics are those of --seed 0: leave it out.")
        from experiments.regress.command import Regression

        check_counts(self, "workers")
        regression = Regression.of(
            self.suite,
            self.case,
            self.baseline,
            self.update,
            config=config,
            workers=self.workers,
            junit=self.junit,
            csv=self.csv,
            quiet=self.common.quiet,
        )
        with output_folder(self.common.out, "result.json") as out:
            return regression.run(out)
