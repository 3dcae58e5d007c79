"""How a product is read: what its files do not say, and what is wanted of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class ReadOptions:
    """How CAD files become a product; a product file (YAML) states most of this itself.

    Attributes:
        units: "mm", "cm", "m" or "in": unit of files that state none. Where all of them state
            theirs, it overrides what they say. None takes files at their word.
        densities: Densities of parts [kg/m3] by name; "" for all that are not named.
        group: Whether identical parts form a group, so that an order lists them as one item.
        split: Whether the bodies of one mesh, and the objects of one file, become parts.
        leave_out: Names of parts, sub-assemblies and files that are not planned.
        depth: Level in the tree of sub-assemblies, from 1 on, at which each is one item; None
            makes every part an item.
        tolerance: Gap up to which parts count as touching [m], if it is given: STEP is then
            tessellated as coarsely as it allows. None for finely.
        outside: Whether a product file may name models and meshes outside of its own folder.
    """

    units: str | None = None
    densities: Mapping[str, float] = field(default_factory=dict)
    group: bool = False
    split: bool = False
    leave_out: tuple[str, ...] = ()
    depth: int | None = None
    tolerance: float | None = None
    outside: bool = False
