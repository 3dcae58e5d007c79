"""Suction under a part in the frozen bed: a cohesive zone on flat faces that seal.

When the beads contract, the membrane is drawn away from a face that lies on it. If no air gets in,
the pressure in the gap falls and the atmosphere pushes the part down. The traction is the declared
strength on closed contact, falls linearly to zero over the declared reach of opening, and a seal
that has opened or slid does not heal.

What seals follows from geometry, on the bed's grid: a cell of the contact is vented within a lip's
width of anything that is not flat contact - the edge of the imprint, a hole, a pin - and a pin or
step that reaches h deeper lifts the membrane like a tent and vents the lip and h around it. Whether
and how strongly silicone seals on metal is an assumption: see `SuctionParameters`, and its switch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cell.soft_jig.bed import Bed
from cell.soft_jig.parameters import SuctionParameters

Array = NDArray[np.float64]

# Neighbours of a flat face differ in height by less than this from its plane [m].
FLAT = 3e-4


@dataclass(frozen=True)
class SealedPatch:
    """One connected flat contact.

    Attributes:
        area: [m2], projected.
        seal: Sealed fraction of the area, 0 (vented) to 1.
    """

    area: float
    seal: float


@dataclass
class Seal:
    """What seals under one part; points and normals are fixed to the bed and to the part alike.

    Attributes:
        p_PS: (n, 3) sealed points in the part frame P [m].
        p_JS: (n, 3) the same points in J when the bed froze [m].
        normals: (n, 3) out of the bed, in J.
        areas: (n,) [m2].
        intact: (n,) what is left of the seal, 1 to 0; it only falls.
        patches: The flat contacts of the part, sealed or not.
    """

    p_PS: Array
    p_JS: Array
    normals: Array
    areas: Array
    intact: Array
    patches: list[SealedPatch]

    @staticmethod
    def under(bed: Bed, name: str, X_JP: tuple[Array, Array], lip: float) -> Seal:
        """Return what seals under a part at the moment when the bed freezes.

        Args:
            bed: Soft, with the part in it.
            name: Of the part's samples.
            X_JP: Rotation matrix and position of the part.
            lip: Width that seals [m].
        """
        heights = bed.underside_over_bed(name)
        contact = heights <= bed.heights
        sealed, patches = sealed_cells(heights, contact, bed.bag.cell, lip)
        slope = _slopes(heights, contact, bed.bag.cell)[sealed]
        steepness = np.sqrt(1 + np.sum(slope**2, axis=1))
        normals = np.column_stack([-slope, np.ones(len(slope))]) / steepness[:, None]
        p_JS = np.column_stack([bed.x[sealed], bed.y[sealed], heights[sealed]]).astype(float)
        p_PS = (p_JS - X_JP[1]) @ X_JP[0]
        areas = bed.bag.cell**2 * steepness
        return Seal(p_PS, p_JS, normals, areas, np.ones(len(areas)), patches)

    def arrays(self) -> dict[str, Array]:
        """Return everything as arrays, for saving."""
        patches = np.array([(patch.area, patch.seal) for patch in self.patches]).reshape(-1, 2)
        names = ("p_PS", "p_JS", "normals", "areas", "intact")
        return {name: getattr(self, name).copy() for name in names} | {"patches": patches}

    @staticmethod
    def from_arrays(arrays: dict[str, Array]) -> Seal:
        """Undo `arrays`."""
        patches = [SealedPatch(float(area), float(seal)) for area, seal in arrays["patches"]]
        names = ("p_PS", "p_JS", "normals", "areas", "intact")
        return Seal(**{name: arrays[name].copy() for name in names}, patches=patches)

    def pull(
        self, X_JP: tuple[Array, Array], pressure: float, params: SuctionParameters
    ) -> tuple[Array, Array]:
        """Return the force (3,) [N] on the part and its torque (3,) [N m] about P, in J.

        Args:
            X_JP: Rotation matrix and position of the part now.
            pressure: Suction on closed contact [Pa].
            params: Reach and lip.
        """
        R_JP, p_JP = X_JP
        arm = self.p_PS @ R_JP.T
        moved = arm + p_JP - self.p_JS
        gap = np.einsum("ij,ij->i", moved, self.normals)
        slip = np.linalg.norm(moved - gap[:, None] * self.normals, axis=1)
        closed = np.clip(1 - gap / params.reach, 0.0, 1.0) * np.clip(1 - slip / params.slip, 0, 1)
        self.intact = np.minimum(self.intact, closed)
        force = -(pressure * self.intact * self.areas)[:, None] * self.normals
        return force.sum(axis=0), np.cross(arm, force).sum(axis=0)


def sealed_cells(
    heights: Array, contact: NDArray[np.bool_], cell: float, lip: float
) -> tuple[NDArray[np.bool_], list[SealedPatch]]:
    """Say which cells of a contact seal, and report each flat patch.

    Args:
        heights: (n, n) of the part's underside over the grid [m]; read where there is contact.
        contact: (n, n) cells where part and bed touch.
        cell: Edge of a cell [m].
        lip: Width that seals [m].
    """
    flat = contact & _level(heights, contact)
    patches = np.zeros(flat.shape, dtype=np.int32)
    ndimage.label(flat, output=patches)
    sealed = np.zeros_like(flat)
    report = []
    for k in range(1, int(patches.max()) + 1):
        patch = patches == k
        # Distance from the patch's border: half a cell nearer than the next cell's middle.
        inside = (np.asarray(ndimage.distance_transform_edt(patch)) - 0.5) * cell
        tight = patch & (inside >= lip) & ~_tented(heights, contact, patch, cell, lip)
        sealed |= tight
        report.append(SealedPatch(float(patch.sum()) * cell**2, float(tight.sum() / patch.sum())))
    return sealed, report


def _slopes(heights: Array, contact: NDArray[np.bool_], cell: float) -> Array:
    """Return dz/dx and dz/dy (n, n, 2), one-sided at the border of the contact."""
    slopes = []
    for axis in (0, 1):
        before = contact & np.roll(contact, 1, axis)
        after = contact & np.roll(contact, -1, axis)
        low = np.where(before, np.roll(heights, 1, axis), heights)
        high = np.where(after, np.roll(heights, -1, axis), heights)
        rise = np.where(contact, high, 0.0) - np.where(contact, low, 0.0)
        cells = before.astype(float) + after
        slopes.append(rise / (np.maximum(cells, 1.0) * cell))
    return np.stack(slopes, axis=2)


def _level(heights: Array, contact: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Say where the surface bends less than `FLAT` between a cell and its neighbours."""
    level = np.ones_like(contact)
    for axis in (0, 1):
        before, after = np.roll(heights, 1, axis), np.roll(heights, -1, axis)
        both = contact & np.roll(contact, 1, axis) & np.roll(contact, -1, axis)
        bend = np.abs(
            np.where(both, before, 0.0)
            + np.where(both, after, 0.0)
            - 2 * np.where(both, heights, 0.0)
        )
        level &= bend < FLAT
    return level


def _tented(
    heights: Array, contact: NDArray[np.bool_], patch: NDArray[np.bool_], cell: float, lip: float
) -> NDArray[np.bool_]:
    """Say where a pin or step that reaches deeper than the patch keeps the membrane off it."""
    level = float(np.median(heights[patch]))
    deeper = np.where(contact & ~patch, level - heights, 0.0)
    tented = np.zeros_like(contact)
    deepest = float(deeper.max(initial=0.0))
    for step in np.arange(cell, deepest + cell, cell):
        reaching = deeper >= step
        if reaching.any():
            far = np.asarray(ndimage.distance_transform_edt(~reaching)) * cell
            tented |= far < lip + step
    return tented
