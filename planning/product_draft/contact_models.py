"""What goes into the holes of a product's parts, and the contact models that follow from it."""

from __future__ import annotations

from manifold3d import Manifold

from cell.cad.contact_model import ContactModel, Use, contact_model
from cell.cad.convex_pieces import to_manifold
from cell.cad.round_features import Cylinder
from planning.product_draft.guess import Guess
from planning.product_draft.joint_guesses import LINE_TO_LINE, SLIDING, shafts_of
from planning.product_draft.recognised import Recognised

GOOD_SHARE, GOOD_SURFACE = 0.02, 0.3  # [A] Errors of volume, and of the surface [mm].
# [A] Radially, of a press fit: no wall holds its shaft, see `cell.workpieces.press_fit` [m].
PRESS_PLAY = 5e-5
LOOSE = 0.1  # [A] Radial clearance of what merely passes a hole, of its radius.


def contact_models(seen: Recognised) -> tuple[dict[str, ContactModel], list[Guess]]:
    """Return the contact models of all parts but screws, with what is said of them."""
    uses = _uses(seen)
    models, guesses = {}, []
    for name, mesh in seen.meshes.items():
        if name in seen.screw_named:
            continue
        features, fixed = seen.features[name], name == seen.base
        shafts = shafts_of(name, seen.features)
        model = contact_model(mesh, features, uses[name], fixed=fixed, shafts=shafts)
        models[name] = model
        guesses.append(_guess(name, model))
    return models, guesses


def bearing_radius(head: float, table: float) -> float:
    """Return the radius of the face under a screw's head [m].

    Args:
        head: Diameter of the head as drawn [m].
        table: Of its bearing face by the standard [mm].
    """
    return min(table / 2e3, 0.47 * head)


def _uses(seen: Recognised) -> dict[str, dict[int, Use]]:
    """Return what goes into each hole, by part and number; what nothing enters is left out."""
    uses: dict[str, dict[int, Use]] = {name: {} for name in seen.meshes}
    for screw in seen.screws:
        uses[screw.into][screw.thread_hole] = Use("thread")
        axis = seen.features[screw.clamps][screw.clamped_hole].axis
        uses[screw.clamps][screw.clamped_hole] = Use(
            "clearance",
            bearing=bearing_radius(screw.head_size[0], screw.head.bearing),
            head_up=bool(axis @ screw.axis > 0.0),
        )
    for fit in seen.fits:
        widened = SLIDING if abs(fit.clearance) < LINE_TO_LINE else 0.0
        if fit.clearance < -LINE_TO_LINE:
            widened = PRESS_PLAY - fit.clearance
        uses[fit.hole][fit.hole_number] = Use("fit", fit.clearance + widened, widened=widened)
    solids = {name: to_manifold(mesh) for name, mesh in seen.meshes.items()}
    for name, own in uses.items():
        others = [solid for other, solid in solids.items() if other != name]
        for number, cylinder in enumerate(seen.features[name]):
            if number not in own and cylinder.hole and _is_used(cylinder, others):
                own[number] = Use("fit", LOOSE * cylinder.radius)
    return uses


def _guess(name: str, model: ContactModel) -> Guess:
    error = model.error
    what = (
        f"{len(model.pieces)} contact pieces, with {100 * error.more:.2g} % more and "
        f"{100 * error.less:.2g} % less volume, up to {error.surface:.2g} mm off the surface"
    )
    near = error.more < GOOD_SHARE and error.surface < GOOD_SURFACE and not model.notes
    reason = "; ".join(model.notes) or "cut along its concave edges"
    return Guess(name, what, reason, 0.9 if near else 0.5)


def _is_used(cylinder: Cylinder, others: list[Manifold]) -> bool:
    """Return whether other parts reach into a hole."""
    length = cylinder.length
    core = Manifold.cylinder(length, 0.9 * cylinder.radius, -1.0, 16)
    core = core.translate([0, 0, cylinder.low]).transform(cylinder.X[:3])
    return any((core ^ other).volume() > 0.01 * core.volume() for other in others)
