"""``soft-jig check`` and its options."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from experiments.cli.common import Common, split_order


@dataclass(frozen=True)
class Check:
    """Say in seconds, without simulating, what would fail if a product were assembled."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")]
    """A name in models/products, or a YAML file anywhere, with its models beside it."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts or groups, separated by commas. Default: the product's first one."""

    fixture: Annotated[str | None, arg(metavar="NAME")] = None
    """soft_jig, rigid_jig, support_jig or flat_plate. Default: workcell.fixture."""

    allow_outside: bool = False
    """Let the product use models outside of the folder of its file."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Print one line per finding; return 0 if nothing fails, else 1."""
        config = self.common.load_config(self.fixture)
        from cell.products.loading import load_product, require_product_file
        from cell.products.read_options import ReadOptions
        from experiments.product.check import run_check

        require_product_file(self.product)
        product = load_product(self.product, ReadOptions(outside=self.allow_outside))
        order = split_order(self.order)
        return run_check(product, order, config, self.common.seed, quiet=self.common.quiet)
