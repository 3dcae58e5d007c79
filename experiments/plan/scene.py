"""Static pictures of parts: bodies in a scene, a camera that frames them, labels."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from pydrake.geometry import GeometryInstance, PerceptionProperties, Rgba, SceneGraph
from pydrake.systems.framework import DiagramBuilder

from experiments.plan.drawn import Body, box
from experiments.reporting.render import View, take_picture

FIELD_OF_VIEW = 24.0  # [deg] Narrow: parallel edges look parallel.
TOWARDS = np.array([1.0, 1.7, 0.9])  # From the scene to the camera.
WIDTH, HEIGHT = 760, 560
LABEL_HEIGHT = 20

Color = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class SceneItem:
    """One body in a picture.

    Attributes:
        body: Its shape and pose.
        color: Red, green, blue from 0 to 1.
        name: Text of its label; "" for none.
        frame: Whether the camera must frame all of it.
    """

    body: Body
    color: Color
    name: str = ""
    frame: bool = True


def picture(shown: Sequence[SceneItem]) -> tuple[bytes, View]:
    """Return a PNG of bodies, and the camera it was taken with.

    Raises:
        NoRendering: This machine cannot render.
    """
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    source = scene_graph.RegisterSource("picture")
    for number, item in enumerate(shown):
        mesh, X_WS = item.body.shape.drake_mesh, item.body.X_WS
        geometry = GeometryInstance(X_WS, mesh, f"part {number}")
        properties = PerceptionProperties()
        properties.AddProperty("phong", "diffuse", Rgba(*item.color, 1.0))
        geometry.set_perception_properties(properties)
        scene_graph.RegisterAnchoredGeometry(source, geometry)
    diagram = builder.Build()
    view = view_of(item.body for item in shown if item.frame)
    context = diagram.CreateDefaultContext()
    return take_picture(scene_graph, context, view, shadows=False), view


def view_of(bodies: Iterable[Body]) -> View:
    """Return a camera that frames bodies, from the front and above."""
    low, high = box(bodies)
    centre, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    distance = 1.02 * radius / np.sin(np.deg2rad(FIELD_OF_VIEW / 2))
    eye = centre + distance * TOWARDS / np.linalg.norm(TOWARDS)
    return View(
        (float(eye[0]), float(eye[1]), float(eye[2])),
        (float(centre[0]), float(centre[1]), float(centre[2])),
        FIELD_OF_VIEW,
        WIDTH,
        HEIGHT,
    )


def figure(png: bytes, view: View, shown: Sequence[SceneItem], caption: str) -> str:
    """Return a picture with its labels as HTML; the labels are SVG text, legible at every size."""
    labels = _labels(view, [item for item in shown if item.name])
    image = (
        f'<image width="{view.width}" height="{view.height}" '
        f'href="data:image/png;base64,{base64.b64encode(png).decode()}"/>'
    )
    return (
        f'<figure><svg class="picture" role="img" viewBox="0 0 {view.width} {view.height}">'
        f"<title>{escape(caption)}</title>{image}{labels}</svg>"
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _labels(view: View, named: Sequence[SceneItem]) -> str:
    """Return the names in a column at the right edge, with a line to each part."""
    at = [projected(view, item.body.bounds.mean(axis=0)) for item in named]
    order = sorted(range(len(named)), key=lambda k: at[k][1])
    lines, y = [], 0.0
    for k in order:
        y = max(y + LABEL_HEIGHT, float(at[k][1]))
        y_text = min(y, view.height - LABEL_HEIGHT * (len(order) - 1 - order.index(k)) - 6)
        x_text = 0.82 * view.width
        lines.append(
            f'<line x1="{at[k][0]:.0f}" y1="{at[k][1]:.0f}" x2="{x_text - 4:.0f}" '
            f'y2="{y_text - 5:.0f}"/><text x="{x_text:.0f}" y="{y_text:.0f}">'
            f"{escape(named[k].name)}</text>"
        )
    return "".join(lines)


def projected(view: View, point: np.ndarray) -> np.ndarray:
    """Return the pixel (2,), column and row, at which a point (3,) of W is seen."""
    p_C = view.X_WC.inverse().multiply(np.asarray(point, float))
    focal = view.height / 2 / np.tan(np.deg2rad(view.fov_deg) / 2)
    return np.array([view.width / 2, view.height / 2]) + focal * p_C[:2] / p_C[2]
