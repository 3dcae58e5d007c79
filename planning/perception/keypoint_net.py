"""A net that says of every pixel of a close-up whether it shows the part, and where keypoints are.

Trained elsewhere, it is read from an ONNX file and run by OpenCV.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import label

from cell.errors import InputError
from cell.paths import is_file, possible_path
from planning.perception.keypoint_card import KeypointCard
from planning.perception.opencv import opencv

Array = NDArray[np.float64]

MIDDLE, SPAN = 127.5, 255.0  # Levels of a pixel become -0.5 to 0.5.


@dataclass(frozen=True, eq=False)
class Seen:
    """What a net sees of the part.

    Attributes:
        pixels: (n, 2) of the close-up that show it: one of so many as the net's stride says.
        directions: (n, K, 2) from each towards each keypoint.
    """

    pixels: Array
    directions: Array


@dataclass(frozen=True, eq=False)
class KeypointNet:
    """See the module.

    Attributes:
        card: Of the net.
    """

    card: KeypointCard
    _net: Any

    @staticmethod
    def read(file: Path, part: str, mesh: trimesh.Trimesh) -> KeypointNet:
        """Return the net in a file, for a part.

        Args:
            file: `NAME.onnx`, with its card beside it.
            part: Name of the part.
            mesh: Its mesh [m].

        Raises:
            InputError: A file is missing or not what it should be, the net is for another part, or
                OpenCV is not installed.
        """
        cv2 = opencv()
        if not is_file(possible_path(file)):
            raise InputError(f"There is no net '{file}'.")
        card = KeypointCard.read(file.with_suffix(".json"))
        card.check_part(part, mesh, file)
        content = file.read_bytes()
        if hashlib.sha256(content).hexdigest() != card.net:
            raise InputError(f"Net '{file}' is not that of its card '{file.stem}.json'.")
        try:
            net = cv2.dnn.readNetFromONNX(np.frombuffer(content, np.uint8))
        except cv2.error as error:
            raise InputError(f"'{file}' is no net that OpenCV reads: {error.err}.") from error
        return KeypointNet(card, net)

    def see(self, image: NDArray[np.uint8]) -> Seen:
        """Return what is seen of the part in a close-up, in one connected piece, the largest.

        Args:
            image: (size, size, 3).
        """
        self._net.setInput(as_input(image[None]))
        output = np.asarray(self._net.forward(), float)[0]
        regions, count = label(output[0] > 0.0)  # type: ignore[misc]
        largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:])) if count else -1
        row, column = np.nonzero(regions == largest)
        directions = output[1:, row, column].T.reshape(len(row), len(output) // 2, 2)
        return Seen(centres(np.column_stack([column, row]), self.card.stride), directions)


def as_input(images: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return images (n, h, w, 3) as a net takes them: (n, 3, h, w)."""
    levels = (images.astype(np.float32) - np.float32(MIDDLE)) / np.float32(SPAN)
    return np.ascontiguousarray(levels.transpose(0, 3, 1, 2))


def centres(cells: NDArray, stride: int) -> Array:
    """Return the pixels in the middle of cells (..., 2) of a net's output."""
    return stride * cells.astype(float) + (stride - 1) / 2.0
