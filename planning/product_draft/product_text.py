"""A drafted product as a product file, with comments on what a person may want to edit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cell.cad.nests import PEDESTAL
from cell.products.joints import Fit, Joint, Press, Rest, Screw
from cell.products.product import Grasp, Part, Product
from planning.product_draft.draft import Draft

SCREW_TURN = 30  # [A] Between the ways to hold a screw about its axis [deg].


def product_text(draft: Draft) -> str:
    """Return the text of a product file."""
    return "\n".join(_lines(draft)) + "\n"


def _lines(draft: Draft) -> Iterator[str]:
    product = draft.product
    yield f"# {product.name}: drafted from CAD by soft-jig init; every line is yours to edit."
    yield "# Lengths in mm, angles in degrees, forces in N, torques in N m: see the key."
    yield "# What was guessed, why, and how surely:"
    yield from (f"#   {guess}" for guess in draft.guesses)
    yield f"name: {_quoted(product.name)}"
    yield f'up: "{product.up}"  # Axis of the CAD frame that points up on the jig.'
    yield f"tray: {product.tray}  # In models/; nests are {PEDESTAL:g} mm above its base plate."
    yield ""
    yield "# model: contact geometry, mass and inertia. tray_pose: where the part waits, in the"
    yield "# tray's frame (middle of its base plate's upper face). A grasp is the jaw's frame in"
    yield "# the part: closing is its x, approach its z (from palm to part), at_mm its origin."
    yield "parts:"
    for part in product.parts.values():
        yield from _part(part, part.name in product.screws)
    if product.groups:
        yield ""
        yield "groups:  # Each is one item of an order."
        for name, members in product.groups.items():
            yield f"  {_quoted(name)}: [{_names(members)}]"
    yield ""
    yield "orders:  # The first is the default; the first part stands on the jig."
    for order in product.orders:
        yield f"  - [{_names(order)}]"
    yield ""
    yield "joints:"
    for joint in _distinct(product):
        yield from _joint(joint, product)


def _part(part: Part, screw: bool) -> Iterator[str]:
    assert part.X_TrayP is not None and part.model is not None
    yield f"  {_quoted(part.name)}:"
    yield f"    model: {_quoted(part.model)}  # {1e3 * part.mass:.4g} g."
    if not part.X_AP.IsNearlyIdentity(1e-12):
        yield f"    assembled_pose: {_pose(part.X_AP)}  # Of the part's frame in the CAD frame."
    yield f"    tray_pose: {_pose(part.X_TrayP)}"
    yield "    grasps:  # Best first." if part.grasps else "    grasps: []  # None was found."
    for grasp in part.grasps:
        yield from _grasp(grasp, screw)


def _grasp(grasp: Grasp, screw: bool) -> Iterator[str]:
    R = grasp.X_PJaw.rotation().matrix()
    yield f"      - name: {grasp.name}"
    yield f"        jaw: {grasp.jaw}"
    yield f"        at_mm: {_vector(1e3 * grasp.X_PJaw.translation(), 3)}"
    yield f"        closing: {_vector(R[:, 0], 9)}"
    yield f"        approach: {_vector(R[:, 2], 9)}"
    yield f"        width_mm: {1e3 * grasp.width:.4g}"
    yield f"        force_N: {grasp.force:g}"
    if screw:
        yield f"        turn: {{axis: [0, 0, 1], every_deg: {SCREW_TURN}}}"


def _distinct(product: Product) -> list[Joint]:
    """Return the joints, of equal screws in a group the first only."""
    grouped = {name: group for group, names in product.groups.items() for name in names}
    seen: set[str] = set()
    found = []
    for joint in product.joints:
        group = grouped.get(joint.part) if isinstance(joint, Screw) else None
        if group is None or group not in seen:
            found.append(joint)
        if group is not None:
            seen.add(group)
    return found


def _joint(joint: Joint, product: Product) -> Iterator[str]:
    if isinstance(joint, Screw):
        grouped = {name: group for group, names in product.groups.items() for name in names}
        yield "  - type: screw"
        yield f"    part: {_quoted(grouped.get(joint.part, joint.part))}  # A part, or a group."
        yield f"    into: {_quoted(joint.into)}  # It has the thread."
        yield f"    clamps: {_quoted(joint.clamps)}  # It is under the head."
        yield f"    thread: {joint.thread}"
        yield f"    diameter_mm: {1e3 * joint.diameter:g}"
        yield f"    pitch_mm: {1e3 * joint.pitch:g}  # ISO 261, coarse."
        yield f"    thread_depth_mm: {1e3 * joint.thread_depth:.5g}  # Engaged when seated."
        yield f"    torque_Nm: {joint.torque:.4g}"
        yield f"    nut_factor: {joint.nut_factor:g}  # K in T = K d F."
        yield f'    drive: "{joint.drive.name}"  # The bit that turns it.'
        yield f"    bit_seat_mm: {1e3 * joint.bit_seat:.4g}  # Its end above the head's underside."
        assert joint.friction_radius is not None
        yield f"    friction_radius_mm: {1e3 * joint.friction_radius:.6g}  # Of the contact model."
        yield f"    passes: {joint.passes}  # 2: all to half the torque first, then to the whole."
    elif isinstance(joint, Fit | Press):
        yield f"  - type: {'press' if isinstance(joint, Press) else 'fit'}"
        yield f"    shaft: {_quoted(joint.shaft)}"
        yield f"    hole: {_quoted(joint.hole)}"
        yield f"    at_mm: {_vector(1e3 * joint.p_AoF, 4)}  # Middle of the mouth of the hole."
        yield f"    depth_mm: {1e3 * joint.depth:.5g}"
        if isinstance(joint, Press):
            yield f"    force_N: {joint.force:.4g}  # It seats it."
    elif isinstance(joint, Rest):
        yield "  - type: rest"
        yield f"    part: {_quoted(joint.part)}"
        yield f"    on: {_quoted(joint.on)}"
        if joint.depth:
            yield f"    depth_mm: {1e3 * joint.depth:.4g}  # So deep it goes into what guides it."


def _pose(X: RigidTransform) -> str:
    rpy = np.rad2deg(RollPitchYaw(X.rotation()).vector())
    text = f"xyz_mm: {_vector(1e3 * X.translation(), 4)}"
    if np.abs(rpy).max() > 1e-9:
        text += f", rpy_deg: {_vector(rpy, 7)}"
    return f"{{{text}}}"


def _vector(values: np.ndarray, digits: int) -> str:
    return "[" + ", ".join(f"{round(float(v), digits) + 0.0:.12g}" for v in values) + "]"


def _names(names: Sequence[str]) -> str:
    return ", ".join(map(_quoted, names))


def _quoted(name: str) -> str:
    """Return a name as YAML reads it back, whatever characters it has."""
    plain = name.replace("_", "").isalnum() and not name[0].isdigit() and name.isascii()
    words = {"null", "true", "false", "yes", "no", "on", "off"}
    if plain and name.lower() not in words:
        return name
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
