"""What one run of the twin is asked to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cell.configuration.config import CellConfig
from cell.products.product import Product
from planning.operations.operation import Operation


@dataclass(frozen=True)
class Job:
    """What to assemble, how far, and what to do with the outcome.

    Attributes:
        product: Every part needs a model and a place in the tray.
        order: Parts or groups in the order of assembly; None for the product's default.
        config: Every number of the cell, as the planner believes it to be.
        seed: Seeds disturbance, sensor noise and sampling planners.
        out: Existing folder for the results.
        view: Whether to show the run in a browser.
        replay: Where to write a page that replays the run; None for none.
        record: Where to write an MCAP recording; None for none.
        video: Where to write an animated GIF; None for none.
        program: Folder for a robot program of the run; None for none.
        quiet: Whether to print nothing.
        command: What is recorded as the command.
        last: The operation to stop after; None for the whole assembly.
        start: Where an earlier run saved its last state, to go on from there; None: from nothing.
    """

    product: Product
    order: tuple[str, ...] | None
    config: CellConfig
    seed: int
    out: Path
    view: bool = False
    replay: Path | None = None
    record: Path | None = None
    video: Path | None = None
    program: Path | None = None
    quiet: bool = False
    command: str = "assemble"
    last: Operation | None = None
    start: Path | None = None
