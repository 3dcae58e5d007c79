"""Where the beads go that a part displaces: shoulder, dilation, slack, and the raised flanks.

Discrete-element runs of a free-flanked dome show no ridge at the part's rim. The ground beside a
sinking part is dragged down with it, over a length that goes with the part's size, and the beads
come up farther out, on the flanks of the bag. They also come up looser: sheared dense beads dilate,
at first by as much as is displaced, in the end by a few percent of the bag. In a rigid cup the
ridge stands nearer, 16 mm from the rim, and the shoulder hardly sinks.

An imprint's wall may stand upright: beads under a confining pressure p have the cohesion
c = p tan(phi), and a vertical cut in them is stable up to 4 c sqrt(Kp) / gamma,
which is far higher than any imprint unless the membrane is slack and the beads weigh nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cell.soft_jig.parameters import SoilParameters

Array = NDArray[np.float64]


@dataclass
class Ledger:
    """Volumes since the bag was inflated [m3].

    Attributes:
        waiting: Displaced and not risen yet.
        swept: Displaced by parts so far.
        dilated: Gained because sheared beads lie looser.
        absorbed: Taken up by slack in the packing.
    """

    waiting: float = 0.0
    swept: float = 0.0
    dilated: float = 0.0
    absorbed: float = 0.0

    def displace(self, volume: float, soil: SoilParameters) -> None:
        """Book a volume that a part has pushed aside."""
        if volume <= 0:
            self.waiting += volume
            return
        taken = min(volume, soil.packing_slack - self.absorbed)
        self.absorbed += taken
        gained = dilation(self.swept + volume, soil) - dilation(self.swept, soil)
        self.swept += volume
        self.dilated += gained
        self.waiting += volume - taken + gained

    def array(self) -> Array:
        """Return everything (4,), for saving."""
        return np.array([self.waiting, self.swept, self.dilated, self.absorbed])


def dilation(swept: float, soil: SoilParameters) -> float:
    """Return the volume that the beads have gained after so much was displaced [m3]."""
    return float(soil.dilation_limit * -np.expm1(-swept / soil.dilation_scale))


def shoulder(
    touched: NDArray[np.bool_], sunk: Array, heights: Array, cell: float, soil: SoilParameters
) -> Array:
    """Return how far the bed beside a sinking part is dragged down (n, n) [m].

    Args:
        touched: (n, n) where the part is in contact.
        sunk: (n, n) how far the surface has sunk there [m].
        heights: (n, n) of the surface [m].
        cell: Edge of a cell [m].
        soil: Share and length of the shoulder.
    """
    far, near = map(
        np.asarray, ndimage.distance_transform_edt(~touched, cell, return_indices=True) or ()
    )
    size = np.sqrt(touched.sum() * cell**2 / np.pi)
    length = max(soil.shoulder_length * size, 1e-9)
    drop = soil.shoulder_share * sunk[tuple(near)] * np.exp(-far / length)
    deepest = np.maximum(heights - heights[tuple(near)], 0.0)  # Not below the part's own rim.
    return np.where(touched, 0.0, np.minimum(drop, deepest))


def rise_weight(touched: NDArray[np.bool_], cell: float, soil: SoilParameters) -> Array:
    """Return how the raised volume is spread around the contact (n, n), relative."""
    far = np.asarray(ndimage.distance_transform_edt(~touched)) * cell / soil.collar_place
    return np.where(touched, 0.0, far**2 * np.exp(-2 * far))
