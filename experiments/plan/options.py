"""Options of ``soft-jig plan``, apart from the command so that parsing them imports little."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class PlanOptions:
    """How a product is read and planned; the defaults are those of the command.

    Attributes:
        units: Length unit of a folder's meshes.
        densities: Densities of parts by name [kg/m3]; "" for all others.
        group: Whether identical parts form groups.
        tolerance: Largest gap that counts as contact and largest overlap that does not block [m].
        cache: Folder of the matrix cache; None for no cache.
        slanted: Whether to report all slanted removal directions and local freedom of each step.
        up: Axis that points up on the jig, "+x" ... "-z"; None for the product's.
    """

    units: str | None = None
    densities: Mapping[str, float] = field(default_factory=dict)
    group: bool = False
    tolerance: float | None = None
    cache: Path | None = None
    slanted: bool = False
    up: str | None = None
