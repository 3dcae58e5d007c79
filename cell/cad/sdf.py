"""SDF text of a part or tray: one link with exact inertia, visuals and contact pieces.

The contact pieces are simpler than the drawn part and have their own friction and stiffness; they
preserve the clearances between mating surfaces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh
from pydrake.geometry import Box, Cylinder
from pydrake.math import RigidTransform, RollPitchYaw

from cell.errors import BadPart
from cell.products.mesh_io import obj_text

LINK = "body"
"""Name of the only link of a part's model."""

Shape = Box | Cylinder | trimesh.Trimesh
Color = tuple[float, float, float]


@dataclass(frozen=True)
class Contact:
    """Contact properties of a piece.

    Attributes:
        friction: Static and dynamic coefficient. Drake combines two as 2 a b / (a + b), so equal
            values on both sides are the value of the pair.
        modulus: Hydroelastic modulus [Pa]; None for a rigid piece. Rigid on rigid falls back to
            point contact between convex hulls.
        hint: Longest edge of the contact mesh of a primitive [m].
        dissipation: Hunt-Crossley dissipation [s/m].
    """

    friction: float
    modulus: float | None = None
    hint: float = 0.01
    dissipation: float = 10.0


@dataclass(frozen=True)
class Piece:
    """One collision geometry.

    Attributes:
        name: Starts with ``bed_`` if it touches the bed of the jig.
        shape: Primitive, or a surface in the part's frame P [m].
        contact: Its contact properties.
        X_PS: Pose of the shape.
        convex: Whether a surface is its own convex hull.
    """

    name: str
    shape: Shape
    contact: Contact
    X_PS: RigidTransform = field(default_factory=RigidTransform)
    convex: bool = False


@dataclass(frozen=True)
class Visual:
    """One visual geometry: a primitive or a surface in the part's frame P [m], and its colour."""

    name: str
    shape: Shape
    color: Color
    X_PS: RigidTransform = field(default_factory=RigidTransform)


@dataclass(frozen=True)
class Inertia:
    """Mass [kg], centre of mass p_PCm [m] and (3, 3) rotational inertia about it [kg m2], in P."""

    mass: float
    p_PCm: np.ndarray
    I_Cm_P: np.ndarray


@dataclass(frozen=True)
class Model:
    """One rigid body, ready to be written as ``<name>/<name>.sdf`` with its meshes beside it.

    Attributes:
        name: Name of the model.
        inertia: Of its only link.
        pieces: Its collision geometries.
        visuals: Its visible shapes.
        whole: Closed surface in P [m] for planning, written as ``<name>.obj``; None for a tray,
            which is not part of a plan.
    """

    name: str
    inertia: Inertia
    pieces: Sequence[Piece]
    visuals: Sequence[Visual]
    whole: trimesh.Trimesh | None = None


def mesh_inertia(mesh: trimesh.Trimesh, mass: float, name: str = "part") -> Inertia:
    """Return the inertia of a body of uniform density with a closed surface [m] and a mass [kg].

    Raises:
        BadPart: The mass is not positive; `name` is that of the part.
    """
    if not mass > 0.0:
        raise BadPart(name, f"its mass is {mass:g} kg; a mass is positive")
    properties = mesh.mass_properties
    I_Cm_P = np.asarray(properties["inertia"]) * (mass / properties["mass"])
    return Inertia(mass, np.asarray(properties["center_mass"]), I_Cm_P)


def write_model(folder: Path, model: Model, source: str | None = None) -> Path:
    """Write ``folder/<name>/<name>.sdf`` and its meshes; return the path of the SDF.

    Args:
        folder: For example ``models/sdf``.
        model: What is written.
        source: What wrote it, for a model of a user's own, which then refers to its meshes by
            their names alone; None for a model of the package.
    """
    home = folder / model.name
    home.mkdir(parents=True, exist_ok=True)
    for piece in model.pieces:
        if isinstance(piece.shape, trimesh.Trimesh):
            (home / f"{piece.name}_contact.obj").write_text(obj_text(piece.shape))
    for visual in model.visuals:
        if isinstance(visual.shape, trimesh.Trimesh):
            (home / f"{visual.name}_visual.obj").write_text(obj_text(visual.shape, normals=True))
    if model.whole is not None:
        (home / f"{model.name}.obj").write_text(obj_text(model.whole))
    path = home / f"{model.name}.sdf"
    path.write_text(sdf_text(model, source))
    return path


def sdf_text(model: Model, source: str | None = None) -> str:
    """Return the SDF of a model; the arguments are those of `write_model`."""
    if source is None:
        uri = f"package://soft_jig_models/sdf/{model.name}/"
        remark = 'Written by "python -m cell.cad"; edit the source there.'
    else:
        uri, remark = "", f"Written by {source}; yours to edit. Lengths in m."
    body = [_inertial(model.inertia)]
    body += [_visual(visual, uri) for visual in model.visuals]
    body += [_collision(piece, uri) for piece in model.pieces]
    return (
        f'<?xml version="1.0"?>\n<!-- {remark} -->\n'
        '<sdf version="1.9" xmlns:drake="drake.mit.edu">\n'
        f'  <model name="{model.name}">\n    <link name="{LINK}">\n'
        + "".join(body)
        + "    </link>\n  </model>\n</sdf>\n"
    )


def _inertial(inertia: Inertia) -> str:
    """Return the inertial element; exponents keep the 1e-9 kg m2 of a bolt exact enough."""
    I = inertia.I_Cm_P  # noqa: E741 - the letter of the quantity.
    names = {"ixx": I[0, 0], "iyy": I[1, 1], "izz": I[2, 2]}
    names |= {"ixy": I[0, 1], "ixz": I[0, 2], "iyz": I[1, 2]}
    # Rounding leaves 1e-22 in place of zeros; it would differ between machines.
    floor = 1e-9 * float(np.trace(I))
    rows = "".join(
        f"          <{k}>{v if abs(v) > floor else 0.0:.9e}</{k}>\n" for k, v in names.items()
    )
    center = " ".join(_number(v) for v in inertia.p_PCm)
    return (
        f"      <inertial>\n        <pose>{center} 0 0 0</pose>\n"
        f"        <mass>{inertia.mass:.9e}</mass>\n"
        f"        <inertia>\n{rows}        </inertia>\n      </inertial>\n"
    )


def _visual(visual: Visual, uri: str) -> str:
    """Return a visual element."""
    color = " ".join(f"{c:.3g}" for c in (*visual.color, 1.0))
    mesh_uri = f"{uri}{visual.name}_visual.obj"
    return (
        f'      <visual name="{visual.name}">\n        <pose>{_pose(visual.X_PS)}</pose>\n'
        f"        <geometry>{_geometry(visual.shape, mesh_uri, False)}</geometry>\n"
        f"        <material><diffuse>{color}</diffuse></material>\n      </visual>\n"
    )


def _collision(piece: Piece, uri: str) -> str:
    """Return a collision element with its contact properties."""
    mesh_uri = f"{uri}{piece.name}_contact.obj"
    return (
        f'      <collision name="{piece.name}">\n        <pose>{_pose(piece.X_PS)}</pose>\n'
        f"        <geometry>{_geometry(piece.shape, mesh_uri, piece.convex)}</geometry>\n"
        "        <drake:proximity_properties>\n"
        + "".join(f"          {line}\n" for line in _proximity(piece.contact))
        + "        </drake:proximity_properties>\n      </collision>\n"
    )


def _proximity(contact: Contact) -> list[str]:
    """Return the lines of a collision's proximity properties."""
    lines = ["<drake:rigid_hydroelastic/>"]
    if contact.modulus is not None:
        lines = [
            "<drake:compliant_hydroelastic/>",
            f"<drake:hydroelastic_modulus>{contact.modulus:g}</drake:hydroelastic_modulus>",
        ]
    return [
        *lines,
        f"<drake:mesh_resolution_hint>{contact.hint:g}</drake:mesh_resolution_hint>",
        "<drake:hunt_crossley_dissipation>"
        f"{contact.dissipation:g}</drake:hunt_crossley_dissipation>",
        f"<drake:mu_static>{contact.friction:.6g}</drake:mu_static>",
        f"<drake:mu_dynamic>{contact.friction:.6g}</drake:mu_dynamic>",
    ]


def _geometry(shape: Shape, mesh_uri: str, convex: bool) -> str:
    """Return the content of a geometry element."""
    if isinstance(shape, trimesh.Trimesh):
        declare = "<drake:declare_convex/>" if convex else ""
        return f"<mesh>{declare}<uri>{mesh_uri}</uri></mesh>"
    if isinstance(shape, Box):
        size = " ".join(_number(v) for v in shape.size())
        return f"<box><size>{size}</size></box>"
    radius, length = _number(shape.radius()), _number(shape.length())
    return f"<cylinder><radius>{radius}</radius><length>{length}</length></cylinder>"


def _pose(X: RigidTransform) -> str:
    """Return "x y z roll pitch yaw" [m, rad]."""
    rpy = RollPitchYaw(X.rotation()).vector()
    return " ".join(_number(v) for v in (*X.translation(), *rpy))


def _number(value: float) -> str:
    """Return a length or angle to 0.1 nanometre without trailing zeros and without -0."""
    return f"{round(float(value), 10) + 0.0:.10g}"
