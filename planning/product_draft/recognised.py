"""What is recognised in CAD: surfaces, round features, screws, fits, materials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from cell.products.materials import DENSITIES
from cell.products.product import Part
from planning.product_draft.joint_guesses import Features, FitGuess, ScrewGuess


@dataclass(frozen=True)
class Recognised:
    """Parts as they are drawn, in the product frame A.

    Attributes:
        meshes: Surfaces by name [m].
        features: Their round holes and bosses.
        screws: Those among them.
        fits: Between the others.
        materials: Their names, by name of the part.
        place: By name, when it comes in the order.
        base: Name of the part that the fixture holds.
    """

    meshes: Mapping[str, trimesh.Trimesh]
    features: Features
    screws: Sequence[ScrewGuess]
    fits: Sequence[FitGuess]
    materials: Mapping[str, str]
    place: Mapping[str, int]
    base: str

    @property
    def densities(self) -> dict[str, float]:
        """By name [kg/m3]."""
        return {name: DENSITIES[material] for name, material in self.materials.items()}

    @property
    def screw_named(self) -> dict[str, ScrewGuess]:
        """The screws by name."""
        return {screw.part: screw for screw in self.screws}

    @property
    def in_order(self) -> list[str]:
        """All names, in the order of assembly."""
        return sorted(self.meshes, key=lambda name: self.place[name])

    def before(self, name: str) -> set[str]:
        """Return the names of what is there when a part comes."""
        return {other for other in self.meshes if self.place[other] < self.place[name]}


def placed(part: Part) -> trimesh.Trimesh:
    """Return the surface of a part in the product frame."""
    mesh = part.mesh.copy()
    mesh.apply_transform(np.asarray(part.X_AP.GetAsMatrix4()))
    return mesh
