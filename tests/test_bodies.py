"""Bodies of one surface are told apart, whatever they share and in whatever order faces come."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, OpType
from tiny_products import box, rod, to_trimesh

from cell.products.bodies import Bodies, bodies_of
from cell.products.half_edges import HalfEdges
from cell.products.surfaces import joined, merged

CUBE = box((10, 10, 10), (0, 0, 0))
HOLLOW = CUBE - box((6, 6, 6), (2, 2, 2))
SHEET = trimesh.Trimesh(1e-3 * np.array([[0, 0, 10], [10, 0, 10], [5, 0, 20]]), [[0, 1, 2]])


def surface(*shapes: Manifold | trimesh.Trimesh) -> trimesh.Trimesh:
    """Return shapes as one file has them: coincident corners merged."""
    meshes = [s if isinstance(s, trimesh.Trimesh) else to_trimesh(s) for s in shapes]
    return merged(joined(meshes))


def with_faces(mesh: trimesh.Trimesh, faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def shuffled(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return with_faces(mesh, np.random.default_rng(0).permutation(mesh.faces))


def inward(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return with_faces(mesh, np.asarray(mesh.faces)[:, ::-1])


def volumes(bodies: Bodies) -> list[float]:
    """Return volumes [mm3] of the bodies, which are sound, smallest first."""
    assert all(solid.is_volume for solid in bodies.solids)
    return sorted(round(1e9 * float(solid.volume), 3) for solid in bodies.solids)


def rows(count: Sequence[int], pitch: float = 10.0) -> list[Manifold]:
    return [CUBE.translate([pitch * i for i in index]) for index in np.ndindex(*count)]


@pytest.mark.parametrize(
    "shapes",
    [
        pytest.param(rows((2, 2, 1), 20), id="separate"),
        pytest.param([CUBE, CUBE.translate([10, 10, 0])], id="common edge"),
        pytest.param([CUBE, CUBE.translate([10, 10, 10])], id="common corner"),
        pytest.param([CUBE, CUBE.translate([10, 0, 0])], id="common face"),
        pytest.param(rows((2, 2, 2)), id="eight around a corner"),
        pytest.param([CUBE, CUBE.translate([5, 5, 5])], id="overlapping"),
        pytest.param(
            [CUBE.rotate([0, 0, 37]), CUBE.rotate([0, 0, 187]), CUBE.rotate([0, 0, 277])],
            id="three around an edge",
        ),
    ],
)
@pytest.mark.parametrize("order", [merged, shuffled, inward], ids=["listed", "shuffled", "inward"])
def test_every_cube_is_a_body(
    shapes: list[Manifold], order: Callable[[trimesh.Trimesh], trimesh.Trimesh]
) -> None:
    bodies = bodies_of(order(surface(*shapes)))
    assert volumes(bodies) == [1000.0] * len(shapes)
    assert bodies.rejected == () and bodies.repair == ""
    shared = Manifold.batch_boolean(shapes, OpType.Add)
    whole, united = bodies.as_one()
    assert 1e9 * whole.volume == pytest.approx(shared.volume()) and whole.is_volume
    assert united == (shared.volume() < 1000.0 * len(shapes) - 1.0)


def test_bodies_that_share_corners_and_overlap_are_told_apart_by_their_order() -> None:
    """The smaller box shares four edges and a face of the cube's bottom."""
    bodies = bodies_of(surface(CUBE, box((10, 10, 5), (0, 0, 0))))
    assert volumes(bodies) == [500.0, 1000.0]
    whole, united = bodies.as_one()
    assert united and 1e9 * whole.volume == pytest.approx(1000.0)


@pytest.mark.parametrize("turn", [merged, inward])
def test_cavities_belong_to_the_body_around_them(turn) -> None:
    assert volumes(bodies_of(turn(surface(HOLLOW)))) == [784.0]
    ball = box((2, 2, 2), (4, 4, 4))
    assert volumes(bodies_of(turn(surface(HOLLOW, ball)))) == [8.0, 784.0]
    nested = box((30, 30, 30), (-10, -10, -10)) - box((20, 20, 20), (-5, -5, -5))
    assert volumes(bodies_of(turn(surface(nested, HOLLOW)))) == [784.0, 19000.0]


def test_a_body_that_faces_inwards_among_others_is_turned() -> None:
    whole = surface(CUBE, CUBE.translate([10, 0, 0]))
    faces = np.array(whole.faces)
    faces[12:] = faces[12:, ::-1]
    assert volumes(bodies_of(with_faces(whole, faces))) == [1000.0, 1000.0]


def test_a_body_that_touches_itself_stays_one() -> None:
    """A ring whose hole and a corner pocket meet along an edge."""
    ring = box((30, 30, 10), (0, 0, 0)) - box((10, 10, 20), (10, 10, -5))
    ring -= box((10, 10, 20), (20, 20, -5))
    merged_ring = shuffled(surface(ring))
    assert not merged_ring.is_watertight
    assert volumes(bodies_of(merged_ring)) == [7000.0]


def test_a_body_that_is_listed_twice_counts_once() -> None:
    bodies = bodies_of(surface(CUBE, CUBE))
    assert volumes(bodies) == [1000.0] and "12 degenerate or doubled faces" in bodies.repair


@pytest.mark.parametrize("sheet", [SHEET, SHEET.copy().apply_translation([0, 0, 0.02])])
def test_a_surface_that_bounds_nothing_is_rejected_with_its_place(sheet: trimesh.Trimesh) -> None:
    """Whether it hangs at an edge of the body or apart from it."""
    bodies = bodies_of(surface(CUBE, sheet))
    assert volumes(bodies) == [1000.0]
    (piece,) = bodies.rejected
    assert piece.reason == "not watertight: 3 open edges"
    assert piece.point is not None and sheet.bounds[0][2] <= piece.point[2] <= sheet.bounds[1][2]


def test_what_is_open_does_not_take_the_sound_with_it() -> None:
    both = surface(CUBE, CUBE.translate([20, 0, 0]))
    bodies = bodies_of(with_faces(both, both.faces[1:]))
    assert volumes(bodies) == [1000.0]
    assert [piece.reason for piece in bodies.rejected] == ["not watertight: 3 open edges"]


def test_what_encloses_no_volume_is_rejected() -> None:
    flat = with_faces(SHEET, np.array([[0, 1, 2], [0, 2, 1]]))
    bodies = bodies_of(surface(CUBE, flat.apply_translation([0, 0, 0.03])))
    assert volumes(bodies) == [1000.0] and len(bodies.rejected) == 1
    assert bodies_of(trimesh.Trimesh()).rejected[0].reason == "no faces"
    broken = trimesh.Trimesh(np.full((3, 3), np.nan), [[0, 1, 2]], process=False)
    assert bodies_of(broken).rejected[0].reason == "corners that are not numbers"


def test_each_body_is_welded_by_itself() -> None:
    """Corners 20 nanometres apart in one of two bodies that touch."""
    soup = to_trimesh(CUBE.translate([10, 0, 0])).triangles.reshape(-1, 3)
    soup = soup + np.random.default_rng(0).uniform(-2e-8, 2e-8, soup.shape)
    loose = trimesh.Trimesh(soup, np.arange(len(soup)).reshape(-1, 3), process=False)
    bodies = bodies_of(surface(CUBE, loose))
    np.testing.assert_allclose(volumes(bodies), [1000.0, 1000.0], rtol=1e-4)
    assert "corners welded within" in bodies.repair


def test_sound_surfaces_stay_as_they_are() -> None:
    """To the last bit, so that results do not depend on how many bodies a model has."""
    for shapes in ([HOLLOW], [CUBE, rod(4, 20, 30)]):
        mesh = surface(*shapes)
        whole, united = bodies_of(mesh).as_one()
        assert not united
        np.testing.assert_array_equal(whole.vertices[whole.faces], mesh.vertices[mesh.faces])


def test_wedges_at_an_edge_pair_the_faces_around_material() -> None:
    """Four cubes around an edge: eight faces at it, of which each two bound a cube."""
    mesh = surface(*rows((2, 2, 1)))
    edges = HalfEdges(np.asarray(mesh.faces))
    assert edges.count.max() == 8 and edges.is_balanced
    cubes = edges.labels(edges.wedges(np.asarray(mesh.vertices)))
    assert sorted(np.bincount(cubes)) == [12, 12, 12, 12]
