"""Round holes and bosses of a triangle mesh: axis, radius, extent, and the chamfers at their ends.

A cylinder is a chain of flat strips that meet at edges along one axis, each turned a little against
the one before, all inwards (a hole) or all outwards (a boss). Corners lie on the drawn circle, so
the radius is that of the corners: flats are nearer to the axis by the sagitta of the facets.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import trimesh

FLAT = np.deg2rad(0.5)  # [A] Faces that meet at less are one flat.
TURN = np.deg2rad(50.0)  # [A] Largest turn between strips: 8 facets; less would be a prism.
WHOLE = np.deg2rad(340.0)  # [A] What goes around less is no hole or boss of its own.
ALONG = 0.9995  # Cosine of 1.8 degrees.
OUT_OF_ROUND = 3e-3  # [A] Of the radius.
SAME_RADIUS = 0.01  # Of the radius: walls that other features interrupt are one.
LARGEST_FLARE = 2.5  # [A] Times the radius: a wider cone is a shape of its own.


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A round hole or boss.

    Attributes:
        axis: (3,) unit vector, whose largest component is positive.
        point: (3,) point on the axis nearest to the frame's origin.
        radius: Of the corners, that is, of the drawn circle.
        facets: Around the whole circle.
        low, high: Extent along the axis, measured from `point`.
        hole: Whether material is outside of it.
        faces: Indices of its faces.
        flare_low, flare_high: Radius and height at which a chamfer beyond each end ends; radius
            and end of the cylinder itself where there is none.
    """

    axis: np.ndarray
    point: np.ndarray
    radius: float
    facets: int
    low: float
    high: float
    hole: bool
    faces: np.ndarray
    flare_low: tuple[float, float] = (0.0, 0.0)
    flare_high: tuple[float, float] = (0.0, 0.0)

    @property
    def mean_radius(self) -> float:
        """Mean of the radii of corners and flats: clearances of unlike facets come out right."""
        return self.radius * (1.0 + np.cos(np.pi / self.facets)) / 2.0

    @property
    def length(self) -> float:
        """Along the axis, without chamfers."""
        return self.high - self.low

    def scaled(self, scale: float) -> Cylinder:
        """Return it in another unit."""
        return replace(
            self,
            point=self.point * scale,
            radius=self.radius * scale,
            low=self.low * scale,
            high=self.high * scale,
            flare_low=(self.flare_low[0] * scale, self.flare_low[1] * scale),
            flare_high=(self.flare_high[0] * scale, self.flare_high[1] * scale),
        )

    def reversed(self) -> Cylinder:
        """Return it with the axis the other way."""
        return replace(
            self,
            axis=-self.axis,
            low=-self.high,
            high=-self.low,
            flare_low=(self.flare_high[0], -self.flare_high[1]),
            flare_high=(self.flare_low[0], -self.flare_low[1]),
        )

    @property
    def X(self) -> np.ndarray:
        """(4, 4) pose of a frame whose z is the axis, and whose x lies along the frame's own."""
        x = np.eye(3)[np.argmin(np.abs(self.axis))]
        x = x - self.axis * (self.axis @ x)
        x /= np.linalg.norm(x)
        X = np.eye(4)
        X[:3] = np.column_stack([x, np.cross(self.axis, x), self.axis, self.point])
        return X

    def coaxial(self, other: Cylinder, tolerance: float) -> bool:
        """Return whether two have the same axis, up to an offset."""
        parallel = abs(float(self.axis @ other.axis)) > ALONG
        return parallel and float(np.linalg.norm(self.point - other.point)) <= tolerance


def cylinders_of(mesh: trimesh.Trimesh) -> list[Cylinder]:
    """Return the whole cylinders of a closed mesh, in its unit, largest faces first."""
    strips = _Strips.of(mesh)
    found: list[Cylinder] = []
    taken = np.zeros(strips.count, bool)
    for edge in np.argsort(-strips.length):
        group, turn = strips.around(edge, taken)
        if turn < np.deg2rad(100.0) or len(group) < 3:
            continue
        cylinder = strips.fitted(edge, group)
        if cylinder is not None:
            taken[list(group)] = True
            found.append(cylinder)
    whole = [c for c in _joined(found) if _turn_of(mesh, c) > WHOLE]
    return [_with_flares(mesh, cylinder) for cylinder in whole]


@dataclass(frozen=True, eq=False)
class _Strips:
    """Flats of a mesh, and the edges at which they meet at no more than `TURN`.

    Attributes:
        mesh: The mesh.
        of_face: (m,) number of the flat of each face.
        count: Of flats.
        normal: (count, 3) of the flats.
        pair: (k, 2) flats at each edge.
        angle, length: (k,) of each edge.
        convex: (k,) whether material is inside of the corner.
        along: (k, 3) direction of each edge.
        ends: (k, 2) its vertices.
        edges_at: Edges by flat.
    """

    mesh: trimesh.Trimesh
    of_face: np.ndarray
    count: int
    normal: np.ndarray
    pair: np.ndarray
    angle: np.ndarray
    length: np.ndarray
    convex: np.ndarray
    along: np.ndarray
    ends: np.ndarray
    edges_at: list[list[int]]

    @staticmethod
    def of(mesh: trimesh.Trimesh) -> _Strips:
        angles = mesh.face_adjacency_angles
        flat = angles < FLAT
        labels = trimesh.graph.connected_component_labels(
            mesh.face_adjacency[flat], node_count=len(mesh.faces)
        )
        count = int(labels.max()) + 1
        weighted = mesh.face_normals * mesh.area_faces[:, None]
        normal = np.stack([np.bincount(labels, weighted[:, k], count) for k in range(3)], axis=1)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
        bent = ~flat & (angles <= TURN)
        pair = labels[mesh.face_adjacency[bent]]
        ends = mesh.face_adjacency_edges[bent]
        along = mesh.vertices[ends[:, 1]] - mesh.vertices[ends[:, 0]]
        length = np.linalg.norm(along, axis=1)
        edges_at: list[list[int]] = [[] for _ in range(count)]
        for edge, (one, other) in enumerate(pair):
            edges_at[one].append(edge)
            edges_at[other].append(edge)
        return _Strips(
            mesh=mesh,
            of_face=labels,
            count=count,
            normal=normal,
            pair=pair,
            angle=angles[bent],
            length=length,
            convex=mesh.face_adjacency_convex[bent],
            along=along / np.maximum(length, 1e-30)[:, None],
            ends=ends,
            edges_at=edges_at,
        )

    def around(self, first: int, taken: np.ndarray) -> tuple[set[int], float]:
        """Return the flats that go on around the direction of an edge, and by how much [rad]."""
        one, other = (int(flat) for flat in self.pair[first])
        if one == other or taken[one] or taken[other]:
            return set(), 0.0
        axis, step, group, todo = self.along[first], self.angle[first], {one, other}, [one, other]
        seams = {(one, other): float(step)}
        while todo:
            flat = todo.pop()
            for edge in self.edges_at[flat]:
                a, b = (int(f) for f in self.pair[edge])
                beyond = b if a == flat else a
                if (
                    taken[beyond]
                    or self.convex[edge] != self.convex[first]
                    or abs(self.along[edge] @ axis) < ALONG
                    or abs(self.normal[beyond] @ axis) > 0.02
                    or not 0.4 * step < self.angle[edge] < 2.5 * step
                ):
                    continue
                seams[min(a, b), max(a, b)] = float(self.angle[edge])
                if beyond not in group:
                    group.add(beyond)
                    todo.append(beyond)
        return group, sum(seams.values())

    def fitted(self, first: int, group: set[int]) -> Cylinder | None:
        """Return the cylinder on which the corners of some flats lie, or None if on none."""
        axis = self.along[first]
        axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
        faces = np.flatnonzero(np.isin(self.of_face, list(group)))
        own = [
            edge
            for flat in group
            for edge in self.edges_at[flat]
            if abs(self.along[edge] @ axis) > ALONG and set(map(int, self.pair[edge])) <= group
        ]
        corners = self.mesh.vertices[np.unique(self.ends[own])]
        across = np.linalg.svd(axis[None])[2][1:]
        flat = corners @ across.T
        system = np.column_stack([2.0 * flat, np.ones(len(flat))])
        centre = np.linalg.lstsq(system, (flat**2).sum(axis=1), rcond=None)[0][:2]
        radii = np.linalg.norm(flat - centre, axis=1)
        radius = float(radii.mean())
        if radii.std() > OUT_OF_ROUND * radius:
            return None
        step = float(np.median(self.angle[own]))
        heights = corners @ axis
        return Cylinder(
            axis=axis,
            point=across.T @ centre,
            radius=radius,
            facets=round(2.0 * np.pi / step),
            low=float(heights.min()),
            high=float(heights.max()),
            hole=not bool(self.convex[first]),
            faces=faces,
        )


def _joined(found: Iterable[Cylinder]) -> list[Cylinder]:
    """Join the pieces of a wall that other features interrupt."""
    done: list[Cylinder] = []
    for one in found:
        for number, other in enumerate(done):
            near = SAME_RADIUS * other.radius
            if (
                one.hole == other.hole
                and abs(one.radius - other.radius) < near
                and one.coaxial(other, 2.0 * near)
                and one.low <= other.high + near
                and other.low <= one.high + near
            ):
                done[number] = replace(
                    other,
                    low=min(one.low, other.low),
                    high=max(one.high, other.high),
                    faces=np.concatenate([other.faces, one.faces]),
                )
                break
        else:
            done.append(one)
    return done


def _turn_of(mesh: trimesh.Trimesh, cylinder: Cylinder) -> float:
    """Return by how much the faces of a cylinder go around its axis [rad]."""
    across = np.linalg.svd(cylinder.axis[None])[2][1:]
    normals = mesh.face_normals[cylinder.faces] @ across.T
    angles = np.sort(np.arctan2(normals[:, 1], normals[:, 0]))
    gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    step = 2.0 * np.pi / cylinder.facets
    return float(2.0 * np.pi - np.sum(gaps[gaps > 1.5 * step] - step))


def _with_flares(mesh: trimesh.Trimesh, cylinder: Cylinder) -> Cylinder:
    """Return a cylinder with the radii and heights at which chamfers at its ends end."""
    offset = mesh.vertices - cylinder.point
    height = offset @ cylinder.axis
    radial = offset - height[:, None] * cylinder.axis
    radius = np.linalg.norm(radial, axis=1)
    tilt = mesh.face_normals @ cylinder.axis
    middle = radial[mesh.faces].mean(axis=1)
    middle /= np.maximum(np.linalg.norm(middle, axis=1), 1e-30)[:, None]
    # The normal of a cone about the axis has no part along the circumference.
    around = mesh.face_normals - tilt[:, None] * cylinder.axis
    around -= (around * middle).sum(axis=1)[:, None] * middle
    conical = (
        (np.abs(tilt) > 0.05)
        & (np.abs(tilt) < 0.98)
        & (np.linalg.norm(around, axis=1) < 0.3)
        & (radius[mesh.faces].max(axis=1) < LARGEST_FLARE * cylinder.radius)
    )
    inside, todo = set(map(int, cylinder.faces)), list(map(int, cylinder.faces))
    neighbours: dict[int, list[int]] = {}
    for one, other in mesh.face_adjacency:
        neighbours.setdefault(int(one), []).append(int(other))
        neighbours.setdefault(int(other), []).append(int(one))
    while todo:
        for face in neighbours.get(todo.pop(), ()):
            if conical[face] and face not in inside:
                inside.add(face)
                todo.append(face)
    cone = np.array(sorted(inside - set(map(int, cylinder.faces))), int)
    vertices = np.unique(mesh.faces[cone]) if len(cone) else np.empty(0, int)
    ends = []
    for end, sign in ((cylinder.low, -1.0), (cylinder.high, 1.0)):
        beyond = vertices[sign * (height[vertices] - end) > 1e-3 * cylinder.radius]
        if len(beyond) == 0:
            ends.append((cylinder.radius, end))
            continue
        last = beyond[np.argmax(sign * height[beyond])]
        ends.append((float(radius[last]), float(height[last])))
    return replace(cylinder, flare_low=ends[0], flare_high=ends[1])
