"""Options of ``soft-jig plan``, apart from the command so that parsing them imports little."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cell.products.read_options import ReadOptions

PLAN, MATRICES, PAGE = "plan.json", "matrices.npz", "plan.html"  # What is written.


@dataclass(frozen=True)
class PlanOptions:
    """How a product is read and planned; the defaults are those of the command.

    Attributes:
        read: How the product is read.
        tolerance: Largest gap that counts as contact and largest overlap that does not block [m].
        cache: Folder of the matrix cache; None for no cache.
        slanted: Whether to report all slanted removal directions and local freedom of each step.
        up: Axis that points up on the jig, "+x" ... "-z"; None for the product's.
        accept, press, snap, flexible: What is declared, as ``declared_from`` reads it.
    """

    read: ReadOptions = ReadOptions()
    tolerance: float | None = None
    cache: Path | None = None
    slanted: bool = False
    up: str | None = None
    accept: tuple[str, ...] = ()
    press: tuple[str, ...] = ()
    snap: tuple[str, ...] = ()
    flexible: tuple[str, ...] = ()
