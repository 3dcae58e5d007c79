"""``soft-jig compare`` and its options."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from experiments.cli.common import Common
from experiments.reporting.output import output_folder


@dataclass(frozen=True)
class Compare:
    """Say what differs between two results, summaries, campaigns or plans beyond its tolerance.

    Exit code 0: nothing differs. 1: something does. 2: they cannot be read or compared.
    """

    a: Annotated[Positional[Path], arg(metavar="A")]
    """The former one: the folder of a command, or a file in it."""

    b: Annotated[Positional[Path], arg(metavar="B")]
    """The present one, of the same kind."""

    junit: Annotated[Path | None, arg(metavar="FILE")] = None
    """Also write JUnit's XML, a test case per step, case, trial or pair of parts."""

    csv: Annotated[Path | None, arg(metavar="FILE")] = None
    """Also write a table of all values."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``compare.json``; return the exit code."""
        from experiments.compare.command import read_pair, run_compare
        from experiments.compare.files import check_files

        self.common.load_config()
        check_files(junit=self.junit, csv=self.csv)
        pair = read_pair(self.a, self.b)
        with output_folder(self.common.out, "compare.json") as out:
            return run_compare(pair, out, junit=self.junit, csv=self.csv, quiet=self.common.quiet)
