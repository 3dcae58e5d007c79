"""The SDF models of a drafted product: its parts, its screws, its tray."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from manifold3d import Manifold
from pydrake.math import RigidTransform, RotationMatrix

from cell.cad.contact_model import ContactModel
from cell.cad.convex_pieces import to_manifold
from cell.cad.nests import Nest, tray_model
from cell.cad.screw_model import screw_model
from cell.cad.sdf import Model, Visual, mesh_inertia, write_model
from cell.products.model_files import OWN_MODELS
from cell.products.product import Part, Product
from cell.vectors import rotation_with_up
from planning.product_draft.contact_models import bearing_radius
from planning.product_draft.joint_guesses import ScrewGuess
from planning.product_draft.recognised import Recognised
from planning.product_draft.tray_layout import SIZE, ScrewRow, lay_out

SOURCE = '"soft-jig init"'
COLORS = ((0.62, 0.70, 0.80), (0.80, 0.62, 0.25), (0.55, 0.56, 0.60), (0.42, 0.60, 0.45))


def write_parts(
    product: Product, seen: Recognised, contacts: Mapping[str, ContactModel], folder: Path
) -> dict[str, Part]:
    """Write the models of all parts; return the parts with their models and frames.

    A part's frame is that of the CAD; a screw's is at the underside of its head, and equal screws
    share a model.
    """
    screws, parts = seen.screw_named, {}
    for name, part in product.parts.items():
        if name in screws:
            parts[name] = _write_screw(screws[name], part, seen, folder)
            continue
        mesh, model = seen.meshes[name], plain(name)
        color = COLORS[seen.place[name] % len(COLORS)]
        inertia = mesh_inertia(mesh, part.mass, name)
        visuals = [Visual(model, mesh, color)]
        pieces = contacts[name].pieces
        write_model(folder / OWN_MODELS, Model(model, inertia, pieces, visuals, mesh), SOURCE)
        parts[name] = replace(part, mesh=mesh, X_AP=RigidTransform(), model=model)
    return parts


def _write_screw(screw: ScrewGuess, part: Part, seen: Recognised, folder: Path) -> Part:
    X_AP = RigidTransform(_upright(screw.axis), screw.p_AoP)
    mesh = seen.meshes[screw.part].copy()
    mesh.apply_transform(X_AP.inverse().GetAsMatrix4())
    length, head = 1e3 * screw.length, screw.head_size
    name = f"screw_{screw.size.name.lower()}x{length:.3g}".replace(".", "_")
    model = screw_model(
        name,
        mesh,
        diameter=screw.size.diameter,
        length=length,
        head=(1e3 * head[0], 1e3 * head[1]),
        bearing=1e3 * bearing_radius(head[0], screw.head.bearing),
        hole=1e3 * seen.features[screw.clamps][screw.clamped_hole].radius,
        density=seen.densities[screw.part],
    )
    write_model(folder / OWN_MODELS, model, SOURCE)
    return replace(part, mesh=mesh, mass=model.inertia.mass, X_AP=X_AP, model=name)


def write_tray(
    product: Product, seen: Recognised, folder: Path
) -> dict[str, tuple[RigidTransform, Nest]]:
    """Write the tray; return X_TrayP and nest by name of the part."""
    R_TA, screws = rotation_with_up(product.up), seen.screw_named
    solids = {n: _turned(R_TA, seen, n) for n in seen.in_order if n not in screws}
    alike: dict[tuple[str, int], list[ScrewGuess]] = {}
    for screw in seen.screws:
        alike.setdefault((screw.size.name, round(1e4 * screw.length)), []).append(screw)
    rows = [
        ScrewRow(
            tuple(screw.part for screw in equal),
            equal[0].size.diameter,
            1e3 * equal[0].length,
            1e3 * equal[0].head_size[0],
        )
        for equal in alike.values()
    ]
    nests = lay_out(solids, rows)
    write_model(folder / OWN_MODELS, tray_model(f"{plain(product.name)}_tray", nests, SIZE), SOURCE)
    return {
        nest.name: (
            RigidTransform(RotationMatrix() if nest.name in screws else R_TA, 1e-3 * nest.p_TrayP),
            nest,
        )
        for nest in nests
    }


def plain(name: str) -> str:
    """Return a name as files and URLs bear it."""
    return "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in name)


def _turned(R_TA: RotationMatrix, seen: Recognised, name: str) -> Manifold:
    """Return a part as it stands in the tray [mm]."""
    mesh = seen.meshes[name].copy()
    mesh.apply_transform(RigidTransform(R_TA, np.zeros(3)).GetAsMatrix4())
    return to_manifold(mesh.apply_scale(1e3))


def _upright(axis: np.ndarray) -> RotationMatrix:
    """Return axes with z along a direction."""
    x = np.eye(3)[np.argmin(np.abs(axis))]
    x = x - axis * (axis @ x)
    x /= np.linalg.norm(x)
    return RotationMatrix(np.column_stack([x, np.cross(axis, x), axis]))
