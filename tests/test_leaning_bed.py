"""The frozen bed under parts that lean slightly, in random directions."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from test_contact_mesh import MOTOR, PARAMS, RIM_SQUEEZE, box, overlap, pressed

from cell.fixtures.soft_jig.mesh import contact_mesh
from cell.fixtures.soft_jig.mesh.contact_mesh import imprint_mesh
from cell.fixtures.soft_jig.mesh.contact_region import ShearedBed
from cell.fixtures.soft_jig.soft.bed import Bed

# The pieces of the model around the plate's hole, and its foot.
PLATE = [
    box([-0.035, -0.028, 0], [-0.02, 0.027, 0.005]),
    box([0.02, -0.028, 0], [0.035, 0.027, 0.005]),
    box([-0.02, 0.0195, 0], [0.02, 0.027, 0.005]),
    box([-0.02, -0.028, 0], [0.02, -0.0195, 0.005]),
    box([-0.035, -0.033, -0.015], [0.035, -0.028, 0.005]),
]
# Part, axis (of the part) that points up.
POSTURES = {
    "motor lying": (MOTOR, [0, -1, 0]),
    "plate face down": (PLATE, [0, 0, -1]),
    "plate on its foot": (PLATE, [0, 1, 0]),
    "plate on its side": (PLATE, [1, 0, 0]),
    "plate foot down": (PLATE, [0, 0, 1]),
}
TILTS_DEG = (0.3, 2.0, 8.0)


def leaning(posture: str, tilt_deg: float, seed: int):
    """Press a part tilted in a random direction; return bed, hulls in J and lean (2,)."""
    hulls, up = POSTURES[posture]
    rng = np.random.default_rng(seed)
    upright = Rotation.align_vectors([[0, 0, 1]], [up])[0]
    yaw, toward = rng.uniform(0, 2 * np.pi, 2)
    tilt = np.radians(tilt_deg) * np.array([np.cos(toward), np.sin(toward), 0])
    R_JP = Rotation.from_rotvec(tilt) * Rotation.from_rotvec([0, 0, yaw]) * upright
    bed, hulls_J = pressed(hulls, R_JP.as_euler("xyz", degrees=True).tolist())
    axis = R_JP.apply(up)
    return bed, hulls_J, axis[:2] / axis[2]


@pytest.mark.parametrize("tilt_deg", TILTS_DEG)
@pytest.mark.parametrize("posture", POSTURES)
def test_bed_of_a_leaning_part_is_valid(posture: str, tilt_deg: float) -> None:
    """Positive tetrahedra, a closed surface, little overlap with the part, and most of the bed.

    The rings are straight from the wall to the aperture: beside a long, narrow contact they cut off
    the bulge of the dome, a quarter of the bed under a plate on its side.
    """
    bed, hulls, lean = leaning(posture, tilt_deg, seed=int(10 * tilt_deg))
    mesh = imprint_mesh(bed, PARAMS.jammed, hulls, lean)
    surface = trimesh.Trimesh(mesh.vertices, mesh.boundary(), process=False)
    assert mesh.volumes().min() > 0
    assert surface.is_watertight
    assert 0.65 * bed.volume < mesh.volumes().sum() < 1.02 * bed.volume
    assert overlap(mesh, hulls) < RIM_SQUEEZE + 0.6e-3


def test_part_on_one_flat_body_is_meshed_without_shear(monkeypatch: pytest.MonkeyPatch) -> None:
    """The standing motor: bit for bit the mesh that results with shear switched off."""
    bed, hulls = pressed(MOTOR, [1.0, 0.5, 20])
    lean = np.array([0.009, -0.017])
    mesh = imprint_mesh(bed, PARAMS.jammed, hulls, lean)
    monkeypatch.setattr(contact_mesh, "MOST_LEAN", -1.0)
    unsheared = imprint_mesh(bed, PARAMS.jammed, hulls, lean)
    assert np.array_equal(mesh.vertices, unsheared.vertices)
    assert np.array_equal(mesh.tetrahedra, unsheared.tetrahedra)


def test_floor_is_the_larger_of_two_patches() -> None:
    """Of two separate blocks only the larger one leaves an imprint."""
    large = box([-0.02, -0.01, 0], [0.005, 0.01, 0.03])
    small = box([0.01, -0.005, 0], [0.02, 0.005, 0.03])
    bed, hulls = pressed([large, small + [0, 0, 2e-4]], [0, 0, 0])
    mesh = imprint_mesh(bed, PARAMS.jammed, hulls)
    alone = imprint_mesh(bed, PARAMS.jammed, hulls[:1])
    level = hulls[0][:, 2].min()

    def floor(vertices: np.ndarray) -> np.ndarray:
        return vertices[np.abs(vertices[:, 2] - level) < 1e-6, :2]

    assert floor(mesh.vertices) == pytest.approx(floor(alone.vertices), abs=2e-4)


def test_sheared_bed_is_the_same_surface() -> None:
    """Its points lie on its own height field, and shearing them back gives the bed."""
    bed = Bed(PARAMS.bag, PARAMS.soil)
    view = ShearedBed(bed, np.array([0.1, -0.05]), 0.03)
    surface = view.surface()
    inner = np.hypot(*surface[:, :2].T) < 0.8 * PARAMS.bag.aperture_radius
    error = view.height_at(surface[inner, :2]) - surface[inner, 2]
    assert np.abs(error).max() < 5e-5
    xy = view.from_sheared(surface)[:, :2]
    assert xy == pytest.approx(np.stack([bed.x[bed.active], bed.y[bed.active]], axis=1))


@pytest.mark.parametrize("toward_deg", [0, 100, 258])
@pytest.mark.parametrize("posture", ["motor lying", "plate on its foot", "plate on its side"])
def test_bed_of_a_part_that_leans_far_beside_the_middle_is_valid(
    posture: str, toward_deg: float
) -> None:
    """15 degrees, 30 mm off the middle: the part hangs over the border of the bag."""
    hulls, up = POSTURES[posture]
    toward = np.radians(toward_deg)
    tilt = np.radians(15.0) * np.array([np.cos(toward), np.sin(toward), 0])
    R_JP = Rotation.from_rotvec(tilt) * Rotation.align_vectors([[0, 0, 1]], [up])[0]
    angles = R_JP.as_euler("xyz", degrees=True).tolist()
    bed, hulls_J = pressed(hulls, angles, aside=0.030)
    axis = R_JP.apply(up)
    mesh = imprint_mesh(bed, PARAMS.jammed, hulls_J, axis[:2] / axis[2])
    surface = trimesh.Trimesh(mesh.vertices, mesh.boundary(), process=False)
    assert mesh.volumes().min() > 0
    assert surface.is_watertight
