"""What is known of a net for keypoints: of which part they are, where, and how it was trained.

The card lies beside the net, `NAME.json` beside `NAME.onnx`, and decides whether the net may be
used: one that was trained with another part's mesh is refused, and so is a file that is not the
card's.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from cell.errors import InputError
from cell.paths import MODELS, is_file, possible_path
from planning.perception.surface import Surface

Array = NDArray[np.float64]

NETS = MODELS / "keypoints"
TRAINING = "python -m experiments.train_keypoints"  # By which nets come about.
KEYPOINTS = 9  # [R] PVNet: the centre and eight of the surface.
AROUND = 1.15  # Edge of a close-up by the diagonal of the part [A]: with some of what is around it.
GRAIN = 1e-6  # To which a mesh has to be the same [m]: less than its file holds.


@dataclass(frozen=True)
class KeypointCard:
    """See the module.

    Attributes:
        part: Name of the part.
        mesh: Its mesh, as `fingerprint` tells it from others.
        p_PK: (K, 3) keypoints in the part's frame, the centre of its box first [m].
        size: Edge of the square image that the net takes [pixels].
        pixels_per_metre: In that image, at the part.
        stride: Pixels of the image by those of the net's output, along each axis.
        covariance_scale: By which errors of poses are larger, squared, than the votes say: those of
            neighbouring pixels are alike. Measured with pictures that were kept from training.
        net: SHA-256 of the file with the net.
        training: Data, seed, steps and the like.
        scores: On pictures that were kept from training.
    """

    part: str
    mesh: str
    p_PK: tuple[tuple[float, float, float], ...]
    size: int
    pixels_per_metre: float
    stride: int
    covariance_scale: float = 1.0
    net: str = ""
    training: Mapping[str, Any] = field(default_factory=dict)
    scores: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def of_part(part: str, mesh: trimesh.Trimesh, size: int, stride: int) -> KeypointCard:
        """Return the card of a net that is still to be trained.

        Args:
            part: Name of the part.
            mesh: Its mesh [m].
            size: Edge of the square image that the net takes [pixels].
            stride: Pixels of the image by those of the net's output.
        """
        surface = Surface.of(mesh)
        points = farthest_points(surface, KEYPOINTS)
        keypoints = tuple((float(x), float(y), float(z)) for x, y, z in points.round(6))
        scale = size / (AROUND * surface.size)
        return KeypointCard(part, fingerprint(mesh), keypoints, size, round(scale, 1), stride)

    @staticmethod
    def read(file: Path) -> KeypointCard:
        """Return the card in a file.

        Raises:
            InputError: There is none, or it is not one.
        """
        if not is_file(possible_path(file)):
            raise InputError(f"'{file}' does not exist: a net is used with its card only.")
        try:
            values = json.loads(file.read_text(encoding="utf-8"))
            values["p_PK"] = tuple((float(x), float(y), float(z)) for x, y, z in values["p_PK"])
            return KeypointCard(**values)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"'{file}' is no card of a net for keypoints: {error}.") from error

    def text(self) -> str:
        """Return the card as its file has it."""
        return json.dumps(asdict(self), indent=1) + "\n"

    def check_part(self, part: str, mesh: trimesh.Trimesh, file: Path) -> None:
        """Refuse the net for a part of another shape.

        Args:
            part: Name of the part.
            mesh: Its mesh [m].
            file: Of the net.

        Raises:
            InputError: The net was trained with another mesh.
        """
        if fingerprint(mesh) == self.mesh:
            return
        if part != self.part:
            raise InputError(f"Net '{file}' is for part '{self.part}', not for '{part}'.")
        raise InputError(
            f"Net '{file}' was trained with another mesh of '{part}': train it anew, {TRAINING}."
        )


def net_file(part: str, folder: Path = NETS) -> Path:
    """Return the file of the net for a part.

    Args:
        part: Name of the part.
        folder: Of nets; by default those that come with the project.

    Raises:
        InputError: There is none.
    """
    file = folder / f"{part}.onnx"
    if not is_file(possible_path(file)):
        known = ", ".join(sorted(path.stem for path in folder.glob("*.onnx"))) or "none"
        raise InputError(
            f"No net for part '{part}' in '{folder}' (there: {known}): train one, {TRAINING}."
        )
    return file


def fingerprint(mesh: trimesh.Trimesh) -> str:
    """Return what tells a mesh from others: SHA-256 of its vertices, in micrometres, and faces."""
    vertices = np.round(mesh.vertices / GRAIN).astype("<i8")
    faces = np.asarray(mesh.faces).astype("<i8")
    return hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()


def farthest_points(surface: Surface, count: int) -> Array:
    """Return points (count, 3): the centre of the box, then always the surface's farthest [m]."""
    found = [surface.centre]
    distance = np.linalg.norm(surface.points - found[0], axis=1)
    while len(found) < count:
        found.append(surface.points[int(distance.argmax())])
        distance = np.minimum(distance, np.linalg.norm(surface.points - found[-1], axis=1))
    return np.array(found)
