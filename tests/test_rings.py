"""The rings around the floor of the frozen bed: columns square to the walls, without crossing."""

from __future__ import annotations

import numpy as np
import pytest
from test_contact_mesh import PARAMS, box, pressed

from cell.fixtures.soft_jig.mesh.contact_mesh import imprint_mesh
from cell.fixtures.soft_jig.mesh.polygons import edge_normals
from cell.fixtures.soft_jig.mesh.rings import BESIDE, outward_directions


def loop_around(corners: list[tuple[float, float]], longest: float = 0.006) -> np.ndarray:
    """Return a counter-clockwise loop (n, 2) with edges no longer than `longest` [m]."""
    points = []
    for a, b in zip(np.array(corners), np.roll(corners, -1, axis=0), strict=True):
        pieces = int(np.ceil(np.linalg.norm(b - a) / longest))
        points += [a + (b - a) * k / pieces for k in range(pieces)]
    return np.array(points)


BAR = [(-0.03, -0.0025), (0.03, -0.0025), (0.03, 0.0025), (-0.03, 0.0025)]
WITH_A_STEP = [(-0.03, -0.01), (0.03, -0.01), (0.03, 0.01), (0.01, 0.01), (0.01, 0.003)]
WITH_A_STEP += [(-0.03, 0.003)]


def test_columns_are_square_to_the_long_sides_of_a_bar() -> None:
    """Within 5 deg: columns oblique to a wall are thin behind it, hence stiff."""
    loop = loop_around(BAR)
    away, (normal, _) = outward_directions(loop), edge_normals(loop)
    inside = np.abs(loop[:, 0]) < 0.029
    square = np.einsum("ij,ij->i", away, normal)[inside]
    assert square.min() > np.cos(np.radians(5))


@pytest.mark.parametrize("corners", [BAR, WITH_A_STEP])
def test_columns_do_not_cross(corners: list[tuple[float, float]]) -> None:
    """Two neighbours on the outline and the points 10 mm outwards of them: counter-clockwise."""
    loop = loop_around(corners)
    outer = loop + 0.010 * outward_directions(loop)
    cells = np.stack([loop, outer, np.roll(outer, -1, axis=0), np.roll(loop, -1, axis=0)], axis=1)
    edge = np.roll(cells, -1, axis=1) - cells
    after = np.roll(edge, -1, axis=1)
    turn = edge[..., 0] * after[..., 1] - edge[..., 1] * after[..., 0]
    assert turn.min() > 0


def test_wall_of_a_bar_is_as_high_as_the_bed_beside_it() -> None:
    """Along both sides, although the border of the bar lies in the middle of cells."""
    bed, hulls = pressed([box([-0.02, -0.0025, 0], [0.02, 0.0025, 0.03])], [0, 0, 20], force=8.0)
    mesh = imprint_mesh(bed, PARAMS.jammed, hulls)
    bottom, turn = hulls[0][:, 2].min(), np.radians(20)
    R_JB = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    center = hulls[0][:, :2].mean(axis=0)
    p_B = (mesh.vertices[:, :2] - center) @ R_JB
    along_sides = (np.abs(np.abs(p_B[:, 1]) - 0.0025) < 2e-4) & (np.abs(p_B[:, 0]) < 0.019)
    rim = along_sides & (mesh.vertices[:, 2] > bottom + 1e-3)
    outside = p_B[rim] + np.sign(p_B[rim]) * [0, BESIDE]
    assert rim.sum() >= 4
    assert mesh.vertices[rim, 2] == pytest.approx(
        bed.height_beside(outside @ R_JB.T + center), abs=1e-3
    )
