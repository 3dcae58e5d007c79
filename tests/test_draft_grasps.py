"""Grasps of drafted parts: force closed, clear of what is around, or with the reason for none."""

import fcl
import numpy as np
import pytest
from drawn_products import meshes
from manifold3d import Manifold

from cell.cad.motor_unit import mesh
from cell.cad.shapes import box, cylinder
from cell.machines.grippers import HAND_E
from experiments.product.drawings import box_with_lid
from planning.product_draft.depth_maps import DepthMaps
from planning.product_draft.grasp_sampling import ABOVE_GROUND, PAD_FRICTION, sample_grasps
from planning.product_draft.hand_shape import HandShape, surface
from planning.product_draft.no_grasp import why_no_grasp

MM = 1e-3
UP = np.array([0.0, 0.0, 1.0])
HAND = HandShape(HAND_E)


def test_depth_maps_of_a_box_are_flat() -> None:
    block = mesh(box((-10, -15, 0), (10, 15, 40)))
    maps = DepthMaps.of(block, np.eye(3))
    assert np.allclose(maps.far, 10 * MM)
    assert np.allclose(maps.near, -10 * MM)
    grip = maps.grip((-5 * MM, 5 * MM), (10 * MM, 30 * MM))
    assert grip is not None
    assert grip.width == pytest.approx(20 * MM)
    assert grip.area == pytest.approx(200 * MM**2, rel=0.15)
    assert grip.force_closed(PAD_FRICTION)


def test_faces_that_are_not_opposite_are_no_grip() -> None:
    """Two ribs, on either side but far apart along the face: the line between them slips."""
    stepped = box((0, -20, 0), (4, -10, 10)) + box((-4, 10, 0), (0, 20, 10))
    stepped += box((-1, -20, 0), (1, 20, 10))
    maps = DepthMaps.of(mesh(stepped), np.eye(3))
    assert maps.grip((-20 * MM, 20 * MM), (0.0, 10 * MM)) is None


@pytest.mark.parametrize("shape", [box((-10, -15, 0), (10, 15, 50)), cylinder(12.0, 0, 50)])
def test_grasps_are_force_closed_and_free_of_collision(shape) -> None:  # noqa: ANN001
    part = mesh(shape)
    ground = surface(mesh(box((-200, -200, -10), (200, 200, 16))))
    found = sample_grasps(part, 0.1, HAND, UP, [ground])
    assert found
    for ranked in found:
        grasp = ranked.grasp
        R = grasp.X_PJaw.rotation().matrix()
        assert np.allclose(R[:, 2], -UP)
        # Between the jaws lies the part: from the middle both ways to half the width.
        face = HAND.faces[grasp.jaw]
        middle = grasp.X_PJaw.translation() + R @ [0.0, *face.middle]
        maps = DepthMaps.of(part, R)
        y, z = R[:, 1] @ middle, R[:, 2] @ middle
        halves = [size / 2 for size in face.size]
        grip = maps.grip((y - halves[0], y + halves[0]), (z - halves[1], z + halves[1]))
        assert grip is not None
        assert grip.force_closed(PAD_FRICTION)
        assert grip.width == pytest.approx(grasp.width)
        # The opened hand stands clear of the ground and of the part.
        opening = grasp.width - HAND_E.setback[grasp.jaw] + 4 * MM
        X = grasp.X_PJaw.GetAsMatrix4()
        X[:3, 3] -= R @ HAND.p_TipJaw[grasp.jaw]
        hand = fcl.CollisionObject(HAND.shape(opening, 0.0), fcl.Transform(X[:3, :3], X[:3, 3]))
        for other in (ground, surface(part)):
            obstacle = fcl.CollisionObject(other, fcl.Transform())
            request, result = fcl.CollisionRequest(), fcl.CollisionResult()
            assert not fcl.collide(hand, obstacle, request, result)


def test_a_lid_is_gripped_above_the_box_that_its_lip_goes_into() -> None:
    """Lid and box are flush: the jaws end between the lip's underside and the lid's."""
    parts = meshes(box_with_lid())
    found = sample_grasps(parts["lid"], 0.03, HAND, UP, [surface(parts["box"])])
    assert found
    for ranked in found:
        jaw, X_PJaw = ranked.grasp.jaw, ranked.grasp.X_PJaw
        face = HAND.faces[jaw]
        end = X_PJaw.translation()[2] - face.middle[1] - face.size[1] / 2
        assert 0.0 < end <= max(ABOVE_GROUND)


def test_a_grip_squeezes_its_pads_by_half_a_millimetre_at_most() -> None:
    """Noses that meet little of a thin plate press with less than on a thick one."""
    assert HAND.stiffness("nose") == pytest.approx(1e7 / 1e-3)
    block = surface(mesh(box((-20, -16, -30), (20, 16, 0))))

    def forces(thickness: float) -> set[float]:
        plate = mesh(box((-20, -16, 0), (20, 16, thickness)))
        found = sample_grasps(plate, 0.03, HAND, UP, [block])
        for ranked in found:
            most = 5e-4 * HAND.stiffness(ranked.grasp.jaw) * ranked.area
            assert ranked.grasp.force < most + 1.0
        return {ranked.grasp.force for ranked in found}

    assert forces(10.0) == {40.0}
    assert min(forces(2.5)) < 40.0


def test_why_a_part_has_no_grasp_is_said() -> None:
    """Too wide; flush in a pocket; or round all over."""
    wide = mesh(box((-40, -50, 0), (40, 50, 20)))
    said = "80 mm across, and hand_e opens 50 mm; as the tool of its arm, gripper_85 opens wider"
    assert said in why_no_grasp(wide, 0.1, HAND, UP, {})
    plate = mesh(box((-20, -16, 0), (20, 16, 5)))
    frame = box((-30, -26, -5), (30, 26, 5)) - box((-20.2, -16.2, 0), (20.2, 16.2, 6))
    around = {
        "its nest": surface(mesh(box((-60, -60, -70), (60, 60, -60)))),
        "'frame'": surface(mesh(frame)),
    }
    assert sample_grasps(plate, 0.01, HAND, UP, [*around.values()]) == []
    why = why_no_grasp(plate, 0.01, HAND, UP, around)
    assert why == "'frame' alone would leave the jaws no room"
    ball = mesh(Manifold.sphere(10.0, 24))
    assert "no two opposite faces" in why_no_grasp(ball, 0.01, HAND, UP, {})
