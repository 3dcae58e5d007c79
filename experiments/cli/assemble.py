"""``soft-jig assemble`` and its options."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from experiments.cli.common import Common, split_order
from experiments.reporting.output import output_folder


@dataclass(frozen=True)
class Assemble:
    """Plan, then run the whole assembly in the twin, with contact forces."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")] = "motor_unit"
    """A name in models/products, or a YAML file."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts or groups, separated by commas. Default: the product's first one."""

    view: bool = False
    """Show the run in a browser while it goes on."""

    replay: Annotated[Path | None, arg(metavar="FILE.html")] = None
    """Write a recording that plays in any browser, offline."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json``, ``log.npz`` and ``report.html``; return the exit code."""
        config = self.common.load_config()
        with contextlib.ExitStack() as folders:
            out = folders.enter_context(output_folder(self.common.out))
            if self.replay is not None:
                folders.enter_context(output_folder(self.replay.absolute().parent))
            from cell.products.loading import load_product
            from experiments.assembly.assemble import run_assemble

            return run_assemble(
                product=load_product(self.product),
                order=split_order(self.order),
                config=config,
                seed=self.common.seed,
                out=out,
                view=self.view,
                replay=self.replay,
                quiet=self.common.quiet,
            )
