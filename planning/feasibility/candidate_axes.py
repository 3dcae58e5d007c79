"""Axes along which parts may leave at an angle, from their contacts, and a cheap test of them.

What can leave at all moves along the faces that it lies on. So axes are proposed by

- contact normals, by their area,
- edges: cross products of two contact normals of a body, for what slides along two faces,
- the axis of a hole or a prism: the direction to which all contact normals of a pair are normal,
- the middle of the cone that a body's contact normals leave free,
- axes of recognised threads, and of parts that are long or round, for contacts that have play.

An axis and its opposite are one. Along an axis, body i cannot start to move against k if that goes
against a contact normal: the local blocking graph. If it is strongly connected, nothing leaves
along the axis, whatever lies further away, and the exact test can be spared.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np
from scipy.optimize import linprog

from planning.feasibility.contact_normals import distinct, facing
from planning.feasibility.solids import Solid, boxes_apart

ALONG = 0.01  # Sine of 0.6 degrees: sliding along a face, within its rounding.
ON_AXIS = 1.0 - 5e-7  # Cosine of 1 mrad: the same as one of the six directions.
SAME_AXIS = 1.0 - 2e-6  # Cosine of 2 mrad: over 25 mm, the usual tolerance of 0.05 mm.
NULL = 1e-4  # [D] Square of 0.6 degrees: share of the normals' spread along an axis across them.
MOST_NORMALS = 10  # [A] Widest of a body, of which edges are made.
CONE_FACES = 60  # [A] Widest normals of a body that bound its cone.
MOST_AXES = 400  # [A] Proposed, those of the largest faces first.
EDGE, CONE, OWN = 0.5, 0.25, 0.02  # [A] Weight of an axis that no face looks along, per area.

Normals = Mapping[tuple[int, int], tuple[np.ndarray, np.ndarray]]
"""Per pair of bodies (i, k): normals (n, 3) out of k where i lies on it, and areas (n,) [m2]."""


def body_normals(
    bodies: Sequence[Sequence[Solid]], pairs: Iterable[tuple[int, int]], tolerance: float
) -> Normals:
    """Return the contact normals of pairs of bodies, given by their numbers.

    Args:
        bodies: Parts that move as one, each.
        pairs: Bodies i and k that touch, each pair once.
        tolerance: Largest distance of faces that lie on each other [m].
    """
    found = {}
    for i, k in pairs:
        parts = [
            facing(a, b, tolerance)
            for a in bodies[i]
            for b in bodies[k]
            if not boxes_apart(a, b, tolerance)
        ]
        if parts:
            own, areas = (np.concatenate(values) for values in zip(*parts, strict=True))
            found[i, k] = distinct(own, areas)
    return found


def candidate_axes(
    solids: Sequence[Solid], normals: Normals, further: Sequence[Sequence[float]] = ()
) -> np.ndarray:
    """Return unit vectors (m, 3) of slanted axes to try, the most promising first.

    Args:
        solids: All parts.
        normals: Of the bodies that touch.
        further: Axes to try as well, for example of threads.
    """
    found: list[tuple[np.ndarray, float]] = []
    of_body: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for (i, k), (own, areas) in normals.items():
        found += zip(own, areas, strict=True)
        found += _null_axis(own, areas)
        of_body.setdefault(i, []).append((own, areas))
        of_body.setdefault(k, []).append((-own, areas))
    for several in of_body.values():
        own, areas = distinct(*(np.concatenate(values) for values in zip(*several, strict=True)))
        found += _null_axis(own, areas)
        widest = range(min(MOST_NORMALS, len(own)))
        for a, b in combinations(widest, 2):
            found.append((np.cross(own[a], own[b]), EDGE * min(areas[a], areas[b])))
        found.append((_middle_of_cone(own), CONE * float(areas.sum())))
    largest = max((weight for _, weight in found), default=1.0)
    found += [(np.array(axis, float), 2.0 * largest) for axis in further]
    for solid in solids:
        found += [(axis, OWN * largest) for axis in _own_axes(solid)]
    return _axes(found)


def local_hits(axes: np.ndarray, normals: Normals, count: int) -> np.ndarray:
    """Return (m, n, n) bool: whether body i, starting along an axis, is held up by body k.

    Args:
        axes: (m, 3) unit vectors.
        normals: Of the bodies that touch.
        count: Number n of bodies.
    """
    hits = np.zeros((len(axes), count, count), bool)
    for (i, k), (own, _) in normals.items():
        if len(own):
            along = axes @ own.T
            hits[:, i, k] = along.min(axis=1) < -ALONG
            hits[:, k, i] = along.max(axis=1) > ALONG
    return hits


def _null_axis(normals: np.ndarray, areas: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Return the axis that all normals are normal to, if there is one and they differ."""
    if len(normals) < 2:
        return []
    spread, vectors = np.linalg.eigh(np.einsum("i,ij,ik->jk", areas, normals, normals))
    if spread[0] > NULL * spread[2] or spread[1] <= NULL * spread[2]:
        return []
    return [(vectors[:, 0], float(areas.sum()))]


def _middle_of_cone(normals: np.ndarray) -> np.ndarray:
    """Return the direction (3,) that goes furthest away from the widest faces, or zero.

    The largest smallest component along the normals, within a cube: a linear programme. Between
    two opposed faces there is no such direction, and edges that touch have no normals.
    """
    own = normals[:CONE_FACES]
    if not len(own) or (own @ own.T).min() < -1.0 + ALONG:
        return np.zeros(3)
    result = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.column_stack([-own, np.ones(len(own))]),
        b_ub=np.zeros(len(own)),
        bounds=[(-1.0, 1.0)] * 3 + [(0.0, 1.0)],
    )
    return np.asarray(result.x[:3]) if result.success and result.x[3] > ALONG else np.zeros(3)


def _own_axes(solid: Solid) -> list[np.ndarray]:
    """Return the principal axes of a part's face normals: of a rod, along and across it."""
    normals = solid.doubled_areas
    lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-30)
    _, vectors = np.linalg.eigh(normals.T @ (normals / lengths[:, None]))
    return list(vectors.T)


def _axes(found: Sequence[tuple[np.ndarray, float]]) -> np.ndarray:
    """Return axes without near repetitions and without the six, heaviest first."""
    if not found:
        return np.zeros((0, 3))
    vectors = np.array([vector for vector, _ in found])
    weights = np.array([weight for _, weight in found])
    lengths = np.linalg.norm(vectors, axis=1)
    usable = lengths > ALONG
    vectors, weights = vectors[usable] / lengths[usable, None], weights[usable]
    slanted = np.abs(vectors).max(axis=1) < ON_AXIS
    vectors, weights = vectors[slanted], weights[slanted]
    kept = np.zeros((0, 3))
    for vector in vectors[np.argsort(-weights, kind="stable")]:
        if not len(kept) or np.abs(kept @ vector).max() < SAME_AXIS:
            largest = vector[int(np.abs(vector).argmax())]
            kept = np.vstack([kept, vector if largest > 0.0 else -vector])
            if len(kept) == MOST_AXES:
                break
    return kept
