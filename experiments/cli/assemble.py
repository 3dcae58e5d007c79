"""``soft-jig assemble`` and its options."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from experiments.cli.common import BadUsage, Common, split_order
from experiments.reporting.output import output_folder, writable_folder

if TYPE_CHECKING:
    from planning.operations.operation import Operation


@dataclass(frozen=True)
class Assemble:
    """Plan, then run the whole assembly in the twin, with contact forces."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")] = "motor_unit"
    """A name in models/products, or a YAML file anywhere, with its models beside it."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts or groups, separated by commas. Default: the product's first one."""

    fixture: Annotated[str | None, arg(metavar="NAME")] = None
    """soft_jig, rigid_jig, support_jig or flat_plate. Default: workcell.fixture."""

    sensor: Annotated[str | None, arg(metavar="NAME")] = None
    """truth, camera or blind: how it is sensed where parts are. Default: sensor.source."""

    start: Annotated[Path | None, arg(metavar="STATE.npz")] = None
    """Go on from state.npz or failed_state.npz of a run with the same product, order and seed."""

    allow_outside: bool = False
    """Let the product use models outside of the folder of its file."""

    view: bool = False
    """Show the run in a browser while it goes on."""

    replay: Annotated[Path | None, arg(metavar="FILE.html")] = None
    """Write a page that replays the run in any browser, offline."""

    record: Annotated[Path | None, arg(metavar="FILE.mcap")] = None
    """Write joint states, wrenches, poses and meshes, for Foxglove."""

    video: Annotated[Path | None, arg(metavar="FILE.gif")] = None
    """Write a short video of the jig; the report shows it, too. Costs some CPU seconds."""

    program: Annotated[Path | None, arg(metavar="DIR")] = None
    """Write the run as a robot program: JSON with conditions and guards, and URScript."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json``, ``log.npz`` and ``report.html``; return the exit code."""
        return self.run_as("assemble")

    def run_as(self, command: str, last: Operation | None = None) -> int:
        """Run under the name of a command or script, up to an operation; return the exit code.

        Raises:
            InputError: Something that was given cannot be used; nothing is written.
        """
        config = self.common.load_config(self.fixture, self.sensor)
        with contextlib.ExitStack() as folders:
            from experiments.assembly.results import FILES

            out = folders.enter_context(output_folder(self.common.out, *FILES))
            files = {"replay": self.replay, "record": self.record, "video": self.video}
            for option, file in files.items():
                if file is not None:
                    folders.enter_context(writable_folder(file.absolute().parent))
                    if file.is_dir() or not file.name:
                        raise BadUsage(f"--{option} {file}: it is a folder, not a file.")
            if self.program is not None:
                folders.enter_context(writable_folder(self.program))
            from cell.products.loading import load_product, require_product_file
            from cell.products.read_options import ReadOptions
            from experiments.assembly.assemble import run_job
            from experiments.assembly.job import Job

            require_product_file(self.product)
            job = Job(
                product=load_product(self.product, ReadOptions(outside=self.allow_outside)),
                order=split_order(self.order),
                config=config,
                seed=self.common.seed,
                out=out,
                view=self.view,
                replay=self.replay,
                record=self.record,
                video=self.video,
                program=self.program,
                quiet=self.common.quiet,
                command=command,
                last=last,
                start=self.start,
            )
            return run_job(job)
