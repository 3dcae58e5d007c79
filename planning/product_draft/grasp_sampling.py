"""Grasps of a part for the parallel-jaw hand: sampled, checked and ranked.

Jaws come from above to pick and place, and from the side to hold a part while it is screwed down.
Everything is in the product frame A, in which parts are drawn where they belong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush

import fcl
import numpy as np
import trimesh
from pydrake.math import RigidTransform, RotationMatrix

from cell.products.product import Grasp
from planning.product_draft.depth_maps import DepthMaps
from planning.product_draft.hand_shape import JAWS, HandShape, surface

PAD_FRICTION = 0.5  # [D] 2 a b / (a + b) of the pads' 0.8 and of 0.36, machined metal.
LEAST_AREA = 5e-6  # [D] Of contact [m2]: a nose on the head of an M3 cap screw has 4.4.
HOLD_AREA = 1e-5  # [A] At least, against a driver: noses slid off 6 mm2, and held by 16 [M] [m2].
GOOD_AREA = 1.5e-4  # [A] More is no better [m2].
STEP = 2.5e-3  # Between jaw places on a part [m].
FINE = 1e-3  # The same along the approach, where the coarse ones leave no room: low hubs [m].
FACES = 0.95  # Cosine of 18 degrees: what looks along the approach.
LEVELS, MOST_LEVELS = 5, 4  # [A] Undersides: digits to which heights are one [m], how many.
SIDES_WANTED = 8  # [A] Closing directions, those with the most area.
MARGIN, TIGHT = 1e-3, 2e-4  # [A] Kept from what stands around, open and closed [m].
# [D] Of the end of a jaw over what the part stands on [m]: closed on a part that is smaller than
# that, and open beside one that is as large.
ABOVE_GROUND = (TIGHT + 1e-4, MARGIN + 1e-4)
BACK = (0.0, 0.015, 0.05)  # Along the approach, where the opened hand is checked [m].
CLEARANCE = 4e-3  # The jaws open this much wider than the part [m]; see operations.grasping.
TILTS = np.deg2rad([0.0, 12.0, 21.0, 24.0])  # [A] Of a side grasp, palm up.
KEPT = 6  # [A] Grasps of one kind that are kept.
FAR_APART = 4e-3  # [A] Grasps that are nearer count as one [m].
LARGEST_FORCE, LEAST_FORCE = 65.0, 5.0  # [R] Of 130 N for both pads; [A] a screw's.
GRAVITY = 9.81
LIFT_FACTOR = 10.0  # [A] Grip over the weight that friction just bears: an arm brakes.
# [A] Of a pad by the grip [m]: jaws that close 1.5 mm further than expected have lost the part.
SQUEEZED = 5e-4
# [A] Of it by the usual grip [-]: 40 N on 8 mm2 of a round hub let it slip out, 15 N held it.
USUAL_SHARE = 0.5
USUAL_FORCE, LIGHT = 40.0, 5e-3  # [A] As of the products drawn by hand [N]; lighter: less [kg].


@dataclass(frozen=True)
class RankedGrasp:
    """A grasp with what speaks for it.

    Attributes:
        grasp: In the part's frame.
        score: More is better.
        area: Of contact [m2].
        lever: Distance of the mass centre from the line between the pads, across the approach [m].
    """

    grasp: Grasp
    score: float
    area: float
    lever: float


def sample_grasps(
    mesh: trimesh.Trimesh,
    mass: float,
    hand: HandShape,
    up: np.ndarray,
    around: Sequence[fcl.BVHModel],
    *,
    from_side: bool = False,
    wanted: float = 0.0,
) -> list[RankedGrasp]:
    """Return grasps of a part, best first.

    Args:
        mesh: The part in A [m].
        mass: [kg].
        hand: The gripper.
        up: (3,) direction that points up on the jig and in the tray.
        around: Surfaces that the hand keeps clear of, where the part is taken or put.
        from_side: Whether the hand comes from the side, and not from above.
        wanted: Grip force per pad, as far as the pads and the gripper bear it [N].
    """
    own = surface(mesh)
    # Held where it is assembled, jaws may close on what is flush with it, too: that holds as well.
    tight = -TIGHT if from_side else TIGHT
    found: list[RankedGrasp] = []
    for step in (STEP,) if from_side else (STEP, FINE):
        for R in _orientations(mesh, up, from_side):
            maps = DepthMaps.of(mesh, R)
            places, kept = list(_places(mesh, hand, maps, R, step)), 0
            for ranked in _best_first(places, mass, hand, maps, R, wanted):
                if from_side and ranked.area < HOLD_AREA:
                    continue
                if kept == 2:
                    break
                if _is_near(ranked, found) or not _is_clear(ranked.grasp, hand, own, around, tight):
                    continue
                found.append(ranked)
                kept += 1
        if found:
            break
    found.sort(key=lambda g: -g.score)
    return _named(found[:KEPT], "side" if from_side else "top")


def _orientations(mesh: trimesh.Trimesh, up: np.ndarray, from_side: bool) -> Iterator[np.ndarray]:
    """Yield the axes of jaws, (3, 3) columns closing, lateral, approach."""
    for closing in closing_directions(mesh, up):
        if not from_side:
            yield np.column_stack([closing, np.cross(-up, closing), -up])
            continue
        level = np.cross(up, closing)
        for approach in (level, -level):
            for tilt in TILTS:
                z = np.cos(tilt) * approach - np.sin(tilt) * up
                yield np.column_stack([closing, np.cross(z, closing), z])


def closing_directions(mesh: trimesh.Trimesh, up: np.ndarray) -> list[np.ndarray]:
    """Return horizontal directions along which there is most surface to grip, both ways each."""
    level = np.abs(mesh.face_normals @ up) < 0.05
    if not level.any():
        return []
    side = np.linalg.svd(up[None])[2][1]
    across = np.cross(up, side)
    normals = mesh.face_normals[level]
    angle = np.round(np.rad2deg(np.arctan2(normals @ across, normals @ side))) % 180.0
    areas = {a: float(mesh.area_faces[level][angle == a].sum()) for a in np.unique(angle)}
    chosen = sorted(areas, key=lambda a: (-round(areas[a], 8), a))[: SIDES_WANTED // 2]
    turns = [np.deg2rad(a + half) for a in chosen for half in (0.0, 180.0)]
    return [np.cos(t) * side + np.sin(t) * across for t in turns]


@dataclass(frozen=True)
class _Place:
    """Where a jaw may grip: which, where the middle of its face is [m], how good that is at best.

    Attributes:
        jaw: Its name.
        y, z: Of the middle of its face, along the jaw's axes [m].
        lever: Distance of the mass centre from it along y [m].
        bound: Score of a grasp there with as much contact as counts.
    """

    jaw: str
    y: float
    z: float
    lever: float
    bound: float


def _best_first(
    places: Sequence[_Place],
    mass: float,
    hand: HandShape,
    maps: DepthMaps,
    R: np.ndarray,
    wanted: float,
) -> Iterator[RankedGrasp]:
    """Yield the grasps with jaws along R that hold a part, whatever else is around, best first.

    A place is looked at only when no grasp that is known is better than it can be.
    """
    found: dict[int, RankedGrasp] = {}
    queue = [(-place.bound, False, number) for number, place in enumerate(places)]
    heapify(queue)
    while queue:
        _, is_found, number = heappop(queue)
        if is_found:
            yield found.pop(number)
            continue
        ranked = _grasp_at(places[number], mass, hand, maps, R, wanted)
        if ranked is not None:
            found[number] = ranked
            heappush(queue, (-ranked.score, True, number))


def _places(
    mesh: trimesh.Trimesh, hand: HandShape, maps: DepthMaps, R: np.ndarray, step: float
) -> Iterator[_Place]:
    """Yield the places of all jaws along R, a step apart along the approach [m]."""
    p_Com = mesh.center_mass @ R
    setback = 1e-3
    undersides = _undersides(mesh, R[:, 2])
    for jaw in JAWS:
        half_y, half_z = (size / 2.0 for size in hand.faces[jaw].size)
        # Besides, with the end of the jaw just above what the part may stand on.
        ends = np.subtract.outer(undersides - half_z, ABOVE_GROUND).ravel()
        zs = [*_steps(maps.z, p_Com[2], half_z - setback, step), *ends]
        for y in _steps(maps.y, p_Com[1], half_y, STEP):
            lever = abs(y - p_Com[1])
            for z in zs:
                bound = 1.0 - 30.0 * lever - 5.0 * abs(z - p_Com[2])
                yield _Place(jaw, float(y), float(z), float(lever), float(bound))


def _undersides(mesh: trimesh.Trimesh, approach: np.ndarray) -> np.ndarray:
    """Return how far along the approach faces look that way, (n,), the part's end among them [m].

    A lid stands on its rim, and not on the lip below it.
    """
    ahead = mesh.face_normals @ approach > FACES
    depths = np.append(mesh.triangles_center[ahead], mesh.vertices, axis=0) @ approach
    levels = np.round(depths[: ahead.sum()], LEVELS)
    area = {level: float(mesh.area_faces[ahead][levels == level].sum()) for level in set(levels)}
    wide = sorted(area, key=lambda level: (-area[level], level))[:MOST_LEVELS]
    return np.unique([*wide, round(float(depths.max()), LEVELS)])


def _grasp_at(
    place: _Place, mass: float, hand: HandShape, maps: DepthMaps, R: np.ndarray, wanted: float
) -> RankedGrasp | None:
    """Return the grasp at a place, if it holds a part of a mass [kg]."""
    face, (least, most) = hand.faces[place.jaw], hand.widths(place.jaw)
    half_y, half_z = face.size[0] / 2.0, face.size[1] / 2.0
    y, z = place.y, place.z
    grip = maps.grip((y - half_y, y + half_y), (z - half_z, z + half_z))
    if (
        grip is None
        or not least <= grip.width <= most - 1e-3
        or grip.area < LEAST_AREA
        or not grip.force_closed(PAD_FRICTION)
    ):
        return None
    most = SQUEEZED * hand.stiffness(place.jaw) * grip.area
    force = _force(mass, place.lever, grip.spread, most, wanted)
    if force is None:
        return None
    p_PJaw = R @ [grip.middle, y - face.middle[0], z - face.middle[1]]
    grasp = Grasp("", place.jaw, RigidTransform(RotationMatrix(R), p_PJaw), grip.width, force)
    score = place.bound - 1.0 + min(grip.area / GOOD_AREA, 1.0)
    return RankedGrasp(grasp, score, grip.area, place.lever)


def _steps(grid: np.ndarray, middle: float, half: float, step: float) -> np.ndarray:
    """Return the places of a face that meets a part, from the middle outwards."""
    low, high = grid[0] - half + step, grid[-1] + half - step
    steps = np.arange(np.ceil((low - middle) / step), np.floor((high - middle) / step) + 1)
    return middle + step * steps[np.argsort(np.abs(steps), kind="stable")]


def _force(mass: float, lever: float, spread: float, most: float, wanted: float) -> float | None:
    """Return the grip force per pad: it bears the weight, and its moment about the pads [N].

    None if that takes more than the gripper gives, or than the pads bear.

    Args:
        mass: [kg].
        lever: Distance of the mass centre from the line between the pads [m].
        spread: Mean distance of what touches from its middle [m].
        most: That squeezes the pads as far as they may be [N].
        wanted: As far as there is that much [N].
    """
    weight = mass * GRAVITY
    bears = weight / (2.0 * PAD_FRICTION)
    turns = weight * lever / (2.0 * PAD_FRICTION * max(spread, 5e-4))
    needed = max(LIFT_FACTOR * bears, 2.0 * turns, LEAST_FORCE)
    usual = min(USUAL_FORCE if mass > LIGHT else LEAST_FORCE, USUAL_SHARE * most)
    most = min(most, LARGEST_FORCE)
    return None if needed > most else float(np.ceil(max(needed, usual, min(wanted, most))))


def _is_near(ranked: RankedGrasp, found: Sequence[RankedGrasp]) -> bool:
    """Return whether a grasp is nearly one of those found."""
    X = ranked.grasp.X_PJaw
    return any(
        other.grasp.jaw == ranked.grasp.jaw
        and np.linalg.norm(other.grasp.X_PJaw.translation() - X.translation()) < FAR_APART
        and other.grasp.X_PJaw.rotation().IsNearlyEqualTo(X.rotation(), 0.2)
        for other in found
    )


def _is_clear(
    grasp: Grasp,
    hand: HandShape,
    own: fcl.BVHModel,
    around: Sequence[fcl.BVHModel],
    tight: float,
) -> bool:
    """Return whether the opened hand comes without touching anything, and closes likewise.

    Closed it keeps the distance ``tight`` from what is around, or reaches as deep into it [m].
    """
    closed = grasp.width - hand.gripper.setback[grasp.jaw]
    opening = min(closed + CLEARANCE, hand.gripper.stroke)
    X_PTip = grasp.X_PJaw @ RigidTransform(-hand.p_TipJaw[grasp.jaw])
    for back in BACK:
        X = X_PTip @ RigidTransform([0.0, 0.0, -back])
        if _hits(hand.shape(opening, MARGIN), X, around) or _hits(
            hand.shape(opening, 0.0), X, [own]
        ):
            return False
    return not _hits(hand.shape(closed, tight), X_PTip, around)


def _hits(hand: fcl.BVHModel, X: RigidTransform, around: Sequence[fcl.BVHModel]) -> bool:
    one = fcl.CollisionObject(hand, fcl.Transform(X.rotation().matrix(), X.translation()))
    others = (fcl.CollisionObject(other, fcl.Transform()) for other in around)
    request = fcl.CollisionRequest()
    return any(fcl.collide(one, other, request, fcl.CollisionResult()) for other in others)


def _named(found: Sequence[RankedGrasp], family: str) -> list[RankedGrasp]:
    """Return grasps with names: those of one family stand in for each other."""
    return [
        replace(ranked, grasp=replace(ranked.grasp, name=f"{family}_{number + 1}"))
        for number, ranked in enumerate(found)
    ]
