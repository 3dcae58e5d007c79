"""200 random assemblies with known answers, as CAD delivers them: anywhere, turned, rounded.

``assembly_kinds`` draws them upright and in millimetres. Here each is turned by one of the 24
turns of a cube, or by any turn, put anywhere within 10 m of the origin, rounded as mesh files
round, and its parts are named and ordered at random. The answers are turned along.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import permutations, product

import numpy as np
import trimesh
from assembly_drafts import SIX, Draft, Pair, Vector
from assembly_kinds import KINDS
from pydrake.math import RigidTransform
from scipy.spatial.transform import Rotation

from cell.products.product import Part, Product

FURTHEST = 10.0  # [m] Of a product from the origin.
ROUNDINGS = (0.0, 1e-9, 1e-8, 1e-7)  # [m] Noise on every corner.


@dataclass(frozen=True)
class Known:
    """What follows from how an assembly was made; lengths in metres, directions in its frame.

    Attributes:
        kind: What it is, for a person.
        feasible: Whether it can be put together, with everything declared that has to be.
        alone: Whether single parts along the six directions suffice, with nothing declared.
        touching: All pairs of parts in contact, at a tolerance of at least ``gap``.
        leaves: (moving, staying) -> directions; pairs that are missing are not known.
        threads: (bolt, nut) of every screw thread.
        overlaps: Depth of every overlap that is not a thread.
        strays: Parts that belong to no other.
        gap: Clearance across which the product hangs together; 0 where parts touch.
        slanted: Part -> direction in which it leaves all others, at an angle to all axes.
        together: Sets of parts that leave the others as one, and only so.
        press: Pairs that have to be declared as press fits.
        snap: Pairs that have to be declared as snap fits.
    """

    kind: str
    feasible: bool
    alone: bool
    touching: frozenset[Pair]
    leaves: Mapping[tuple[str, str], frozenset[str]]
    threads: frozenset[tuple[str, str]] = frozenset()
    overlaps: Mapping[Pair, float] = field(default_factory=dict)
    strays: frozenset[str] = frozenset()
    gap: float = 0.0
    slanted: Mapping[str, Vector] = field(default_factory=dict)
    together: tuple[frozenset[str], ...] = ()
    press: frozenset[Pair] = frozenset()
    snap: frozenset[Pair] = frozenset()


@dataclass(frozen=True, eq=False)
class Assembly:
    """A product and what is known of it."""

    number: int
    product: Product
    known: Known


def assemblies(seed: int = 0) -> Iterator[Assembly]:
    """Yield the random assemblies, the same for the same seed."""
    number = 0
    for make, count in KINDS.values():
        for _ in range(count):
            rng = np.random.default_rng([seed, number])
            yield assembly(number, make(rng), rng)
            number += 1


def assembly(number: int, draft: Draft, rng: np.random.Generator) -> Assembly:
    """Return a draft as it could lie in a file: turned, far away, rounded, in any order."""
    anyhow = draft.kind in ANY_TURN and rng.random() < 0.3
    turn = Rotation.random(rng=rng).as_matrix() if anyhow else _cube_turn(rng)
    place = rng.uniform(-1, 1, 3) * 10.0 ** rng.uniform(-3, np.log10(FURTHEST))
    rounding = float(rng.choice(ROUNDINGS))
    names = [f"{rng.integers(100, 1000)}_{name}" for name in draft.shapes]
    new = dict(zip(draft.shapes, names, strict=True))
    parts = {}
    for name in rng.permutation(list(draft.shapes)):
        mesh = draft.shapes[name].to_mesh64()
        vertices = 1e-3 * np.array(mesh.vert_properties)[:, :3] @ turn.T + place
        vertices += rng.uniform(-rounding, rounding, vertices.shape)
        surface = trimesh.Trimesh(vertices, np.array(mesh.tri_verts, int), process=False)
        mass = 1000.0 * float(draft.shapes[name].volume()) * 1e-9
        parts[new[name]] = Part(new[name], surface, mass, RigidTransform())
    made = Product(f"{number}_{draft.kind}".replace(" ", "_"), parts)
    return Assembly(number, made, _known(draft, turn, new, slanted=anyhow))


ANY_TURN = ("pegs", "screwed cover", "stack with nut", "box in box", "hinge", "ball in cavity",
            "overlapping boxes")  # fmt: skip
"""Kinds of which some are turned by any angle: then they leave along none of the six directions."""


def _known(draft: Draft, turn: np.ndarray, new: Mapping[str, str], *, slanted: bool) -> Known:
    def named(pair: Pair) -> Pair:
        return frozenset(new[name] for name in pair)

    def way(vector: np.ndarray | Vector) -> Vector:
        x, y, z = (float(v) for v in turn @ np.asarray(vector))
        return (x, y, z)

    leaves = {
        (new[a], new[b]): frozenset(turned(j, turn) for j in ways)
        for (a, b), ways in draft.leaves.items()
        if not slanted
    }
    out = {new[name]: way(vector) for name, vector in draft.slanted.items()}
    return Known(
        kind=draft.kind + (", at an angle" if slanted else ""),
        feasible=draft.feasible,
        alone=draft.alone and not slanted,
        touching=frozenset(map(named, draft.touching)),
        leaves=leaves,
        threads=frozenset((new[bolt], new[nut]) for bolt, nut in draft.threads),
        overlaps={named(pair): 1e-3 * depth for pair, depth in draft.overlaps.items()},
        strays=frozenset(new[name] for name in draft.strays),
        gap=1e-3 * draft.gap,
        slanted=out,
        together=tuple(map(named, draft.together)),
        press=frozenset(map(named, draft.press)),
        snap=frozenset(map(named, draft.snap)),
    )


def vector_of(direction: str) -> np.ndarray:
    """Return "+x" ... "-z" as a (3,) vector."""
    return (1.0 if direction[0] == "+" else -1.0) * np.eye(3)["xyz".index(direction[1])]


def turned(direction: str, turn: np.ndarray) -> str:
    """Return one of the six directions after a turn, or reflection, of the cube."""
    along = turn @ vector_of(direction)
    return next(j for j in SIX if along @ vector_of(j) > 0.5)


def cube_maps() -> list[np.ndarray]:
    """Return the 48 turns and reflections of a cube, (3, 3) each."""
    return [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]


def _cube_turn(rng: np.random.Generator) -> np.ndarray:
    turns = [one for one in cube_maps() if np.linalg.det(one) > 0.0]
    return turns[int(rng.integers(len(turns)))]


def mapped(given: Product, turn: np.ndarray) -> Product:
    """Return a product turned, or mirrored, about the origin."""
    parts = {}
    for name, part in given.parts.items():
        mesh = part.mesh.copy()
        mesh.vertices = np.asarray(mesh.vertices) @ turn.T
        if np.linalg.det(turn) < 0.0:
            mesh.invert()
        parts[name] = Part(name, mesh, part.mass, RigidTransform())
    return Product(given.name, parts)
