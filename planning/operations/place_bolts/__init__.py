"""Operations place_bolts and place_loose_bolts: bolts from the tray into their holes.

The second is for holes below which the part with the thread is not there yet.
"""

from cell.products.joints import Screw
from planning.operations.operation import NoOperation, Operation, Role, Scene, Step
from planning.operations.place_bolts.limits import LIMITS, LOOSE_LIMITS
from planning.operations.place_bolts.measures import measure, measure_loose
from planning.operations.place_bolts.phases import carry_out, foresee


def plan(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to stand bolts on their threads, if those are all there."""
    screws = _screws(scene, parts)
    if screws and all(screw.into in scene.standing for screw in screws):
        return Step("place bolts", PLACE_BOLTS, parts)
    return None


def plan_loose(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to put bolts loose into holes, if some thread is not there yet."""
    screws = _screws(scene, parts)
    if screws and not all(screw.into in scene.standing for screw in screws):
        return Step("place bolts", PLACE_LOOSE_BOLTS, parts)
    return None


def _screws(scene: Scene, parts: tuple[str, ...]) -> list[Screw]:
    """Return the joints of bolts, none if not all parts are bolts.

    Raises:
        NoOperation: What a bolt clamps is not there.
    """
    screws = scene.product.screws
    if not all(part in screws for part in parts):
        return []
    for screw in (screws[part] for part in parts):
        if screw.clamps not in scene.standing:
            raise NoOperation(
                f"No operation brings '{screw.part}' to {', '.join(scene.standing)}: what it "
                f"clamps, '{screw.clamps}', is not there yet."
            )
    return [screws[part] for part in parts]


PLACE_BOLTS = Operation(
    name="place_bolts",
    carry_out=carry_out,
    measure=measure,
    limits=LIMITS,
    role=Role.BRING,
    joint=Screw,
    coarse=True,
    plan=plan,
    foresee=foresee,
)
PLACE_LOOSE_BOLTS = Operation(
    name="place_loose_bolts",
    carry_out=carry_out,
    measure=measure_loose,
    limits=LOOSE_LIMITS,
    role=Role.BRING,
    joint=Screw,
    coarse=True,
    plan=plan_loose,
    foresee=foresee,
)
