"""The mesh of the frozen bed: valid, conforming to the part, and complete."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cell.fixtures.soft_jig.mesh.contact_mesh import bed_mesh, imprint_mesh
from cell.fixtures.soft_jig.mesh.polygons import (
    area,
    clip,
    conforming_cells,
    lower_facets,
    outline,
    subtract,
)
from cell.fixtures.soft_jig.mesh.tet_mesh import BadMesh, TetMesh
from cell.fixtures.soft_jig.parameters import JigParameters
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.fixtures.soft_jig.soft.samples import SurfaceSamples

PARAMS = JigParameters()
# Depth to which the rim of a wall overlaps the part [m].
RIM_SQUEEZE = 2 * abs(PARAMS.jammed.squeeze)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def prism(radius: float, low: float, high: float, n: int = 24) -> NDArray[np.float64]:
    angle = np.arange(n) * 2 * np.pi / n
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (low, high)])


def box(low: list[float], high: list[float]) -> NDArray[np.float64]:
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T


MOTOR = [prism(0.0175, -0.0534, -0.024), prism(0.0185, -0.024, 0.0)]
PLATE = [
    box([-0.035, -0.033, 0], [0.035, 0.027, 0.005]),
    box([-0.035, -0.033, -0.015], [0.035, -0.028, 0]),
]
# Foot and face as neighbours, as in the model: if they lean, their undersides part or overlap.
PLATE_PIECES = [
    box([-0.035, -0.028, 0], [0.035, 0.027, 0.005]),
    box([-0.035, -0.033, -0.015], [0.035, -0.028, 0.005]),
]
POSTURES = {
    "motor standing": (MOTOR, [0, 0, 0]),
    "motor standing, turned": (MOTOR, [0, 0, 17]),
    "motor lying": (MOTOR, [90, 0, 0]),
    "motor lying, turned": (MOTOR, [90, 0, 30]),
    "plate face down": (PLATE, [180, 0, 0]),
    "plate foot down": (PLATE, [0, 0, 0]),
    "plate foot down, leaning back": (PLATE_PIECES, [-0.4, 0.1, 75]),
    "plate foot down, leaning forward": (PLATE_PIECES, [0.4, 0.1, 10]),
    "plate on its foot": (PLATE, [90, 0, 0]),
    "plate on its foot, turned": (PLATE, [90, 0, 20]),
}


def pressed(
    hulls: list[NDArray[np.float64]],
    euler_deg: Sequence[float],
    force: float = 20.0,
    aside: float = 0.0,
):
    """Press convex hulls into a bed quasi-statically and freeze it; return bed and hulls in J."""
    R_JP = Rotation.from_euler("xyz", euler_deg, degrees=True).as_matrix()
    mesh = trimesh.util.concatenate([trimesh.convex.convex_hull(h) for h in hulls])
    assert isinstance(mesh, trimesh.Trimesh)
    samples = SurfaceSamples.of("part", mesh)
    corners = np.concatenate(hulls) @ R_JP.T
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2
    bed = Bed(PARAMS.bag, PARAMS.soil)
    p_JP = np.array([aside - center[0], -center[1], PARAMS.bag.cap_height - corners[:, 2].min()])
    carried = 0.0
    while carried < force:
        p_JP[2] -= 2e-5
        motion = (np.zeros(3), np.array([0, 0, -0.02]))
        carried = bed.press((R_JP, p_JP), motion, samples, 1e-3)[0][2]
        bed.settle(1e-3)
    bed.jam(PARAMS.vacuum.contraction)
    return bed, [hull @ R_JP.T + p_JP for hull in hulls]


def overlap(mesh: TetMesh, hulls: list[NDArray[np.float64]]) -> float:
    """Return the largest depth of points on the mesh's surface inside the part [m]."""
    corners = mesh.vertices[mesh.boundary()]
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], 100)
    points = np.einsum("kj,tjc->tkc", weights, corners).reshape(-1, 3)
    depth = []
    for hull in hulls:
        equations = ConvexHull(hull).equations
        depth.append(float((-(points @ equations[:, :3].T + equations[:, 3]).max(axis=1)).max()))
    return max(depth)


@pytest.fixture(scope="module", params=POSTURES)
def imprint(request):
    hulls, euler_deg = POSTURES[request.param]
    bed, hulls_J = pressed(hulls, euler_deg)
    return bed, hulls_J, imprint_mesh(bed, PARAMS.jammed, hulls_J)


def test_imprint_has_positive_tetrahedra_and_a_closed_surface(imprint) -> None:
    """Every edge of the surface belongs to two triangles, and the surface encloses the volume."""
    _, _, mesh = imprint
    surface = trimesh.Trimesh(mesh.vertices, mesh.boundary(), process=False)
    assert mesh.volumes().min() > 0
    assert surface.is_watertight
    assert surface.volume == pytest.approx(mesh.volumes().sum(), rel=1e-9)


def test_imprint_overlaps_the_part_by_no_more_than_the_squeeze(imprint) -> None:
    """Only the rim of the wall does, and 0.25 mm at the end of the plate's foot."""
    _, hulls, mesh = imprint
    assert overlap(mesh, hulls) < RIM_SQUEEZE + 0.25e-3


def test_imprint_has_the_volume_of_the_bed(imprint) -> None:
    """The mesh omits the steep border of the cap and cuts the dome by chords: 20 % at most."""
    bed, _, mesh = imprint
    assert 0.8 * bed.volume < mesh.volumes().sum() < bed.volume


def test_imprint_has_few_enough_tetrahedra_to_simulate(imprint) -> None:
    _, _, mesh = imprint
    assert len(mesh.tetrahedra) < 1600


def test_floor_shares_the_facets_of_a_standing_part() -> None:
    """The floor under a standing prism is its bottom polygon, offset by the gap at the foot."""
    bed, hulls = pressed(MOTOR, [0, 0, 0])
    mesh = imprint_mesh(bed, PARAMS.jammed, hulls)
    bottom = hulls[0][:, 2].min()
    top = np.abs(mesh.vertices[:, 2] - bottom) < 1e-9
    rim = np.hypot(*mesh.vertices[top, :2].T)
    assert np.sum(np.abs(rim - 0.0175) < 1e-8) == 24


def test_wall_closes_on_the_part_by_the_squeeze() -> None:
    """The mean offset of the wall, between the gap at its foot and its rim, is the squeeze."""
    bed, hulls = pressed(MOTOR, [0, 0, 0])
    mesh = imprint_mesh(bed, PARAMS.jammed, hulls)
    inner = np.hypot(*mesh.vertices[:, :2].T) < 0.0178
    rim = inner & (mesh.vertices[:, 2] > hulls[0][:, 2].min() + 2e-3)
    radius = np.hypot(*mesh.vertices[rim, :2].T) * np.cos(np.pi / 24)
    apothem = 0.0175 * np.cos(np.pi / 24)
    assert np.sum(rim) >= 24
    assert (radius.mean() + apothem) / 2 == pytest.approx(apothem + PARAMS.jammed.squeeze, abs=1e-6)


def test_wall_of_a_leaning_part_leans_with_it() -> None:
    """At 1 deg the walls stay parallel to the part: no overlap beyond the squeeze at the rim."""
    bed, hulls = pressed(MOTOR, [1, 0, 0], 10.0)
    lean = np.array([0.0, -np.tan(np.radians(1))])
    assert overlap(imprint_mesh(bed, PARAMS.jammed, hulls, lean), hulls) < RIM_SQUEEZE + 0.03e-3


def test_plate_in_pieces_around_a_hole_gives_one_floor() -> None:
    """Four boxes around a hole make the imprint of the whole plate."""
    pieces = [
        box([-0.035, -0.033, 0], [-0.01, 0.027, 0.005]),
        box([0.01, -0.033, 0], [0.035, 0.027, 0.005]),
        box([-0.01, -0.033, 0], [0.01, -0.01, 0.005]),
        box([-0.01, 0.01, 0], [0.01, 0.027, 0.005]),
    ]
    bed, hulls = pressed([box([-0.035, -0.033, 0], [0.035, 0.027, 0.005])], [0, 0, 0])
    pieces_J = [piece + (hulls[0].min(axis=0) - [-0.035, -0.033, 0]) for piece in pieces]
    whole = imprint_mesh(bed, PARAMS.jammed, hulls)
    joined = imprint_mesh(bed, PARAMS.jammed, pieces_J)
    assert joined.volumes().sum() == pytest.approx(whole.volumes().sum(), rel=1e-6)


@pytest.mark.parametrize("force", [0.05, 0.3, 1.0])
def test_round_part_that_touches_lightly_is_meshed(force: float) -> None:
    """A lying can that covers no facet by half leaves no imprint: the mesh is the bed's surface."""
    bed, hulls = pressed(MOTOR, [90, 0, 0], force)
    assert imprint_mesh(bed, PARAMS.jammed, hulls).volumes().min() > 0


def test_part_above_the_bag_leaves_no_imprint() -> None:
    bed = Bed(PARAMS.bag, PARAMS.soil)
    above = [hull + [0, 0, 0.2] for hull in MOTOR]
    mesh, dome = imprint_mesh(bed, PARAMS.jammed, above), bed_mesh(bed, PARAMS.jammed)
    assert np.array_equal(mesh.vertices, dome.vertices)


def test_vtk_text_lists_every_vertex_and_tetrahedron() -> None:
    mesh = bed_mesh(Bed(PARAMS.bag, PARAMS.soil), PARAMS.jammed)
    lines = mesh.vtk().splitlines()
    assert lines[4] == f"POINTS {len(mesh.vertices)} double"
    assert lines.count("10") == len(mesh.tetrahedra)


def test_largest_depth_of_a_cube_is_half_its_edge() -> None:
    """Edge 2, with a single interior vertex at the centre."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    hull = trimesh.convex.convex_hull(corners)
    apex = np.zeros((1, 3))
    tetrahedra = np.column_stack([hull.faces[:, ::-1], np.full(len(hull.faces), 8)])
    mesh = TetMesh(np.concatenate([hull.vertices, apex]), tetrahedra)
    assert mesh.largest_depth() == pytest.approx(1.0)
    assert mesh.volumes().sum() == pytest.approx(8.0)


def test_clipping_and_subtracting_conserve_area() -> None:
    """The intersection and the pieces outside add up to the polygon."""
    hole = SQUARE * 0.5 + 0.3
    inside = area(clip(SQUARE, hole))
    outside = sum(area(piece) for piece in subtract(SQUARE, hole))
    assert inside == pytest.approx(0.25)
    assert inside + outside == pytest.approx(1.0)


def test_lower_facet_of_a_box_is_its_bottom() -> None:
    (facet,) = lower_facets(box([0, 0, 0.1], [1, 2, 3]))
    assert area(facet.polygon) == pytest.approx(2.0)
    assert facet.height(np.array([[0.5, 0.5]])) == pytest.approx(0.1)


def test_cells_take_over_the_hanging_vertices_of_their_neighbours() -> None:
    """Two small squares beside a large one: the large one gets the vertex between them."""
    big = SQUARE * 2
    cells = [big, SQUARE + [2, 0], SQUARE + [2, 1]]
    _, welded = conforming_cells(cells, longest=10.0)
    assert len(welded[0]) == 5
    assert len(outline(welded)) == 7


def test_cells_around_a_hole_are_refused() -> None:
    """The jig meshes a single outline; four bars around a square have two."""
    low, high = SQUARE * [3, 1], SQUARE * [3, 1] + [0, 2]
    left, right = SQUARE + [0, 1], SQUARE + [2, 1]
    _, welded = conforming_cells([low, high, left, right], longest=10.0)
    with pytest.raises(BadMesh, match="hole"):
        outline(welded)
