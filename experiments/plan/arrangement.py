"""Arrangement of the parts in a picture: on the jig before a step, or as an exploded view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
import trimesh
from pydrake.math import RigidTransform

from cell.fixtures.soft_jig import BagParameters
from cell.products.product import Product
from cell.vectors import rotation_with_up
from experiments.plan.drawn import Body, DrawnProduct, Shape, box
from experiments.plan.scene import Color, SceneItem
from planning.feasibility.algorithm import FixingStep
from planning.feasibility.directions import opposite

MOVED: Color = (0.93, 0.52, 0.13)
ARROW: Color = (0.80, 0.10, 0.12)
BAG: Color = (0.16, 0.33, 0.30)
BASE: Color = (0.42, 0.44, 0.47)
PARTS: tuple[Color, ...] = (  # Muted, and distinguishable with red-green colour blindness.
    (0.62, 0.66, 0.72),
    (0.36, 0.52, 0.72),
    (0.80, 0.72, 0.45),
    (0.55, 0.42, 0.62),
    (0.45, 0.62, 0.62),
    (0.70, 0.55, 0.52),
)
MOST_LABELS = 14  # More would cover the picture.
GAP = 0.35  # Of the size of the moved parts, between the parts in a picture.


def step_arrangement(
    drawn: DrawnProduct, step: FixingStep, bag: BagParameters, depth: float
) -> list[SceneItem]:
    """Return the product in its posture on the jig, and the moved parts with the mating arrow.

    Args:
        drawn: The product and the shapes of its parts.
        step: Algorithm 1's choice.
        bag: Of the jig.
        depth: Of the fixed body's lowest point below the bag's apex [m].
    """
    turned = {n: _turned(drawn, n, step.up) for n in (*step.target, *step.incoming)}
    below = step.incoming if step.posture == opposite(step.up) else step.target
    moved = step.target if below is step.incoming else step.incoming
    sign = 1.0 if moved is step.incoming else -1.0
    leaving = sign * rotation_with_up(step.up).matrix() @ np.array(step.leaves_along)
    low, high = box(turned[name] for name in below)
    middle = (low + high) / 2
    to_bag = np.array([-middle[0], -middle[1], bag.cap_height - depth - low[2]])
    turned = {name: body.moved(to_bag) for name, body in turned.items()}
    start = _separation([turned[n] for n in moved], [turned[n] for n in below], leaving)
    turned |= {name: turned[name].moved(start * leaving) for name in moved}
    shown = [*jig(bag), *_parts(drawn.product, turned, moved)]
    pointer = Body(Shape(arrow([turned[n] for n in moved], -leaving)))
    return [*shown, SceneItem(pointer, ARROW)]


def exploded(drawn: DrawnProduct, steps: Sequence[FixingStep]) -> list[SceneItem]:
    """Return an exploded view: each item moved out against its mating direction."""
    assembled = list(steps[0].target)
    names = [*assembled, *(name for step in steps for name in step.incoming)]
    turned = {name: _turned(drawn, name, steps[0].up) for name in names}
    for step in steps:
        leaving = rotation_with_up(step.up).matrix() @ np.array(step.leaves_along)
        moved = [turned[name] for name in step.incoming]
        distance = _separation(moved, [turned[name] for name in assembled], leaving)
        turned |= {name: turned[name].moved(distance * leaving) for name in step.incoming}
        assembled += step.incoming
    return _parts(drawn.product, turned, ())


def _turned(drawn: DrawnProduct, name: str, up: str) -> Body:
    """Return a part in its assembled pose, the product turned with ``up`` up."""
    return Body(drawn.shapes[name], RigidTransform(rotation_with_up(up), np.zeros(3)))


def _separation(moved: Sequence[Body], staying: Sequence[Body], along: np.ndarray) -> float:
    """Return the distance to move along a direction until there is a gap [m]."""
    end = max(float((body.vertices @ along).max()) for body in staying)
    start = min(float((body.vertices @ along).min()) for body in moved)
    low, high = box(moved)
    return max(0.0, end - start) + GAP * float(np.linalg.norm(high - low))


def _parts(product: Product, turned: Mapping[str, Body], moved: Sequence[str]) -> list[SceneItem]:
    """Return parts in one colour per item; the first part of a group has the group's label."""
    labels = {name: name for name in turned}
    for group, members in product.groups.items():
        for number, name in enumerate(name for name in members if name in labels):
            labels[name] = "" if number else group
    labelled = [name for name, text in labels.items() if text]
    labels |= dict.fromkeys(labelled[MOST_LABELS:], "")
    place = {n: k for k, item in enumerate(product.items()) for n in product.members(item)}
    return [
        SceneItem(body, MOVED if name in moved else PARTS[place[name] % len(PARTS)], labels[name])
        for name, body in turned.items()
    ]


def arrow(bodies: Sequence[Body], along: np.ndarray) -> trimesh.Trimesh:
    """Return an arrow beside a body that points along a direction."""
    low, high = box(bodies)
    size = float(np.linalg.norm(high - low))
    length, radius = max(0.6 * size, 0.015), max(0.02 * size, 0.0008)
    shaft = trimesh.creation.cylinder(radius, 0.65 * length, sections=24)
    shaft.apply_translation([0, 0, 0.325 * length])
    # Few facets, so that each has its own normal: smoothed normals would shade the tip black.
    tip = trimesh.creation.cone(2.5 * radius, 0.35 * length, sections=8)
    tip.apply_translation([0, 0, 0.65 * length])
    whole = trimesh.util.concatenate([shaft, tip])
    turn = trimesh.geometry.align_vectors([0, 0, 1], along)
    whole.apply_transform(turn)
    beside = np.array([1.0, -1.0, 0.0]) if abs(along[2]) > 0.5 else np.array([0.0, 0.0, 1.0])
    reach = np.abs(beside) @ (high - low) / 2 / np.abs(beside).sum() + 5 * radius
    start = (low + high) / 2 + beside * reach - 0.3 * length * along
    return whole.apply_translation(start)


@cache
def jig(bag: BagParameters) -> tuple[SceneItem, ...]:
    """Return bag and base plate, the same in every picture."""
    shapes = (bag_mesh(bag), BAG), (base_mesh(bag), BASE)
    return tuple(SceneItem(Body(Shape(mesh)), color, frame=False) for mesh, color in shapes)


def bag_mesh(bag: BagParameters) -> trimesh.Trimesh:
    """Return the undisturbed bag: a spherical cap on z = 0."""
    angles = np.linspace(0.0, np.arcsin(bag.aperture_radius / bag.cap_radius), 24)
    if bag.cap_height > bag.cap_radius:
        angles = np.linspace(0.0, np.pi - angles[-1], 24)
    profile = bag.cap_radius * np.column_stack([np.sin(angles), np.cos(angles)])
    profile[:, 1] -= bag.cap_radius - bag.cap_height
    return trimesh.creation.revolve(profile[::-1], sections=96)


def base_mesh(bag: BagParameters) -> trimesh.Trimesh:
    """Return the jig's base plate as a disc below z = 0."""
    disc = trimesh.creation.cylinder(1.35 * bag.aperture_radius, 0.012, sections=96)
    return disc.apply_translation([0, 0, -0.006])
