"""``soft-jig plan`` and its options."""

from __future__ import annotations

import contextlib
import io
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from tyro.conf import OmitArgPrefixes, Positional, UseAppendAction, arg

from experiments.cli.common import BadUsage, Common, split_order
from experiments.reporting.output import output_folder

if TYPE_CHECKING:
    from experiments.plan.options import PlanOptions


@dataclass(frozen=True)
class Plan:
    """Decide, for each assembly step, which part the jig holds and in which posture."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")]
    """A name in models/products, a YAML or CAD file, or a folder of CAD in assembled pose."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts or groups, separated by commas. Default: the product's, or the best."""

    units: Annotated[str | None, arg(metavar="mm|cm|m|in")] = None
    """Unit of meshes that state none. Without such: overrides what STEP and GLB state."""

    density: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="[PART=]KG_M3")] = ()
    """Density of a part, or of all that are not named; a YAML file states masses. Repeatable."""

    group: bool = False
    """Make one item of the order of parts that are identical."""

    depth: Annotated[int | None, arg(metavar="N")] = None
    """Make one item of each sub-assembly at level N of the tree, from 1. Default: of each part."""

    split: bool = False
    """Make parts of the bodies or objects that one mesh or solid model holds."""

    leave_out: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = ()
    """Leave a part, sub-assembly or file out of the plan. Repeatable."""

    up: Annotated[str | None, arg(metavar="+x|-x|...|-z")] = None
    """Axis that points up on the jig; write --up=-z. Default: the product's, or +z."""

    tolerance_mm: Annotated[float | None, arg(metavar="MM")] = None
    """Gap that still touches, overlap that does not block. Default: the product's, or derived."""

    accept: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="A,B|all")] = ()
    """Ignore the overlap of two parts, or every overlap. Repeatable."""

    press: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="A,B")] = ()
    """Declare the overlap of two parts as a press fit. Repeatable."""

    snap: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="A,B")] = ()
    """Declare that one of two parts snaps over an undercut of the other. Repeatable."""

    flexible: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="PART")] = ()
    """Declare that a part bends or stretches over what is in its way, like a belt. Repeatable."""

    slanted: bool = False
    """Also report every way out at an angle, needed or not, and how far parts can move at all."""

    no_cache: bool = False
    """Compute the matrices anew, and do not keep them in the user's cache."""

    allow_outside: bool = False
    """Let the product use meshes and models outside of the folder of its file."""

    explain: bool = False
    """Also print the matrices, every candidate, and which pair blocks which direction, where."""

    no_html: bool = False
    """Write no plan.html, whose pictures take some seconds."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``plan.json``, ``matrices.npz`` and ``plan.html``; return the exit code."""
        config = self.common.load_config()
        stdout = io.StringIO() if self.common.quiet else sys.stdout
        from experiments.plan.options import MATRICES, PAGE, PLAN

        with (
            output_folder(self.common.out, PLAN, MATRICES, PAGE) as out,
            contextlib.redirect_stdout(stdout),
        ):
            from experiments.plan.command import run_plan

            return run_plan(
                self.product,
                split_order(self.order),
                self.options(),
                self.explain,
                out,
                config=config,
                html=not self.no_html,
            )

    def options(self) -> PlanOptions:
        """Return how the product is read and planned."""
        from cell.products.read_options import ReadOptions
        from experiments.plan.options import PlanOptions
        from planning.feasibility.cache import user_cache

        if self.tolerance_mm is not None and not 1e-6 <= self.tolerance_mm < 10.0:
            raise BadUsage(f"--tolerance-mm must be from 1e-6 to 10, not {self.tolerance_mm:g}.")
        tolerance = None if self.tolerance_mm is None else 1e-3 * self.tolerance_mm
        return PlanOptions(
            read=ReadOptions(
                units=self.units,
                densities=dict(map(split_density, self.density)),
                group=self.group,
                split=self.split,
                leave_out=self.leave_out,
                depth=self.depth,
                tolerance=tolerance,
                outside=self.allow_outside,
            ),
            tolerance=tolerance,
            cache=None if self.no_cache else user_cache(),
            slanted=self.slanted,
            up=self.up,
            accept=self.accept,
            press=self.press,
            snap=self.snap,
            flexible=self.flexible,
        )


def split_density(text: str) -> tuple[str, float]:
    """Return the name, "" for all parts, and the value of a density written "[PART=]VALUE"."""
    name, _, value = text.rpartition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise BadUsage(f"--density {text}: write it like 7850 or bolt=7850.") from None
