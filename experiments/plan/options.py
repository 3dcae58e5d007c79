"""How ``soft-jig plan`` reads and plans a product, where that is not the default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class PlanOptions:
    """How a product is read and planned, where that is not the default.

    Attributes:
        units: Length unit of a folder's meshes.
        densities: Densities of parts by name [kg/m3]; "" for the rest.
        group: Whether identical parts form groups.
        tolerance: Gap that still touches, and overlap that does not block [m].
        cache: Folder in which matrices are kept by content.
        slanted: Whether to look for ways out at an angle and for local freedom.
        up: Axis that points up on the jig, "+x" ... "-z"; None for the product's.
    """

    units: str | None = None
    densities: Mapping[str, float] = field(default_factory=dict)
    group: bool = False
    tolerance: float | None = None
    cache: Path | None = None
    slanted: bool = False
    up: str | None = None
