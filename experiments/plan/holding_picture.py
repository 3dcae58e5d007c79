"""The holding map of a step's choice, drawn on the body: what it bears before it moves, and how.

Around the body, cones point in the directions in which it is pulled, coloured by the force that it
bears there. Two polar charts, of the pulls up and of those down, have the numbers, with the
criterion that fails first; tables have the moments, and the margins for the loads of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import product as combinations

import numpy as np
import trimesh
from pydrake.math import RigidTransform

from cell.vectors import rotation_with_up
from experiments.plan.drawn import Body, DrawnProduct, Shape
from experiments.plan.scene import Color, SceneItem, figure, picture
from experiments.reporting.html_page import table
from planning.fixture_analysis.candidate import Candidate, Judged
from planning.fixture_analysis.holding_map import CRITERIA, Bearing

MOST, TURN_MOST = 40.0, 1.5  # Up to which the map goes [N], [N m] [A].
MOST_CASES = 6  # Loads of a step that are listed: those with the smallest margin.
BODY: Color = (0.72, 0.75, 0.79)
STOPS: tuple[Color, ...] = (  # From little to much: viridis, legible in grey and if colour blind.
    (0.267, 0.005, 0.329),
    (0.230, 0.322, 0.546),
    (0.128, 0.567, 0.551),
    (0.369, 0.789, 0.383),
    (0.993, 0.906, 0.144),
)
RADIUS, DOT = 130, 20  # Of a chart and of a direction on it [pixel].


def directions() -> tuple[np.ndarray, np.ndarray]:
    """Return unit forces (26, 3), along axes, edges and corners of a cube, and moments (6, 3)."""
    ways = np.array([w for w in combinations((-1.0, 0.0, 1.0), repeat=3) if any(w)])
    return ways / np.linalg.norm(ways, axis=1)[:, None], np.vstack([np.eye(3), -np.eye(3)])


def holding_picture(drawn: DrawnProduct, candidate: Candidate, judged: Judged) -> str:
    """Return the map of a candidate as HTML.

    Args:
        drawn: The product and the shapes of its parts.
        candidate: Algorithm 1's choice.
        judged: The body on its fixture, and the loads of the step.
    """
    forces, moments = directions()
    none = np.zeros_like
    wrenches = np.vstack([np.hstack([none(forces), forces]), np.hstack([moments, none(moments)])])
    most = np.repeat([MOST, TURN_MOST], [len(forces), len(moments)])
    found = judged.held.bears(wrenches, most)
    pulls, turns = found[: len(forces)], found[len(forces) :]
    # What bears more than was asked for has the last colour.
    top = max((pull.load for pull in pulls if pull.moved), default=MOST)
    colors = [_color(pull.load, top) for pull in pulls]
    shown = _scene(drawn, candidate, judged, forces, colors)
    png, view = picture(shown)
    caption = f"What {candidate.name} bears, {candidate.up} up: least {_least(forces, pulls)}"
    charts = "".join(
        _chart(forces, pulls, colors, sign, title)
        for sign, title in ((1.0, "pulled up and sideways"), (-1.0, "pressed down and sideways"))
    )
    meaning = "; ".join(f"{name}: {text}" for name, text in CRITERIA.items())
    return (
        "<details open><summary>Holding map</summary>"
        f'<div class="figures">{figure(png, view, shown, caption)}{charts}</div>'
        f"<p>Forces at the centre of mass [N] and what fails first. {escape(meaning)}.</p>"
        f"{_moments(moments, turns)}</details>"
    )


def _color(load: float, top: float) -> Color:
    at = float(np.clip(load / top, 0.0, 1.0)) * (len(STOPS) - 1)
    red, green, blue = (
        float(np.interp(at, np.arange(len(STOPS)), [stop[k] for stop in STOPS])) for k in range(3)
    )
    return red, green, blue


def _scene(
    drawn: DrawnProduct,
    candidate: Candidate,
    judged: Judged,
    forces: np.ndarray,
    colors: Sequence[Color],
) -> list[SceneItem]:
    """Return the body with a cone for each direction around its centre of mass."""
    held = judged.held
    X_JA = RigidTransform(rotation_with_up(candidate.up), held.p_JA)
    bodies = [Body(drawn.shapes[name], X_JA) for name in candidate.body]
    corners = np.concatenate([body.vertices for body in bodies])
    around = 0.95 * float(np.linalg.norm(corners - held.p_JG, axis=1).max())
    items = [SceneItem(body, BODY) for body in bodies]
    for way, color in zip(forces, colors, strict=True):
        # Few facets, so that each has its own normal: smoothed normals would shade the tip black.
        cone = trimesh.creation.cone(0.07 * around, 0.25 * around, sections=8)
        cone.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], way))
        at = RigidTransform(held.p_JG + around * way)
        items.append(SceneItem(Body(Shape(cone), at), color))
    return items


def _least(ways: np.ndarray, found: Sequence[Bearing]) -> str:
    worst = int(np.argmin([bearing.load for bearing in found]))
    return f"{_load(found[worst])} N along {_words(ways[worst])} ({found[worst].criterion})"


def _load(bearing: Bearing) -> str:
    return f"{'' if bearing.moved else '> '}{bearing.load:.3g}"


def _words(way: np.ndarray) -> str:
    """Return the axes of J along which a direction goes, "+x -z"."""
    signs = zip(way, "xyz", strict=True)
    return " ".join(f"{'+' if part > 0 else '-'}{axis}" for part, axis in signs if abs(part) > 0.1)


def _chart(
    ways: np.ndarray, found: Sequence[Bearing], colors: Sequence[Color], sign: float, title: str
) -> str:
    """Return the directions above the horizon, or below it, seen along the vertical."""
    size = RADIUS + DOT + 16
    dots = []
    for way, bearing, color in zip(ways, found, colors, strict=True):
        if sign * way[2] < -0.1:
            continue
        # The distance from the middle is the angle to the vertical.
        angle = np.arccos(np.clip(sign * way[2], -1.0, 1.0)) / (np.pi / 2)
        level = way[:2] / max(float(np.linalg.norm(way[:2])), 1e-9)
        x, y = RADIUS * angle * level[0], -RADIUS * angle * level[1]
        ink = "#000" if sum(color) > 1.3 else "#fff"
        fill = "#" + "".join(f"{round(255 * part):02x}" for part in color)
        load = f"{bearing.load:.3g}" if bearing.moved else f"&gt;{bearing.load:.0f}"
        dots.append(
            f'<circle cx="{x:.0f}" cy="{y:.0f}" r="{DOT}" fill="{fill}"/>'
            f'<text x="{x:.0f}" y="{y + 1:.0f}" fill="{ink}" class="dot">{load}</text>'
            f'<text x="{x:.0f}" y="{y + 11:.0f}" fill="{ink}" class="why">'
            f"{escape(bearing.criterion)}</text>"
        )
    axes = (
        f'<circle r="{RADIUS}" class="rim"/><text x="{size - 6}" y="4">x</text>'
        f'<text x="0" y="{10 - size}">y</text>'
    )
    return (
        f'<figure><svg class="polar" role="img" width="{2 * size}" '
        f'viewBox="{-size} {-size} {2 * size} {2 * size}"><title>{escape(title)}</title>'
        f"{axes}{''.join(dots)}</svg><figcaption>{escape(title)}</figcaption></figure>"
    )


def _moments(ways: np.ndarray, found: Sequence[Bearing]) -> str:
    rows = [
        {"moment about": _words(way), "bears [N m]": _load(b), "fails first": b.criterion}
        for way, b in zip(ways, found, strict=True)
    ]
    return table(rows, list(rows[0]))


def load_table(judged: Judged) -> str:
    """Return the loads of a step with the smallest margins, as HTML."""
    rows = [
        {
            "load of the step": f"{_force(case.force)} N"
            + (f" and {case.torque:.2g} N m" if case.torque else ""),
            "over the mass centre [mm]": f"{1e3 * (case.p_JQ[2] - judged.held.p_JG[2]):+.0f}",
            "is borne": f"{_load(case.bearing)} times",
            "fails first": case.bearing.criterion,
        }
        for case in sorted(judged.cases, key=lambda case: case.bearing.load)[:MOST_CASES]
    ]
    head = f"By the holding map, the {len(rows)} loads of the step with the least margin:"
    return f"<p>{head}</p>{table(rows, list(rows[0]))}"


def _force(force: np.ndarray) -> str:
    return "(" + ", ".join(f"{part:.3g}" for part in force) + ")"
