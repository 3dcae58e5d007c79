"""Operation pick_place: a part from the tray onto the fixture, pressed in and held there."""

from planning.operations.operation import Operation, Role, Scene, Step
from planning.operations.pick_place.limits import LIMITS
from planning.operations.pick_place.measures import measure
from planning.operations.pick_place.phases import foresee
from planning.operations.pick_place.recovery import carry_out


def plan(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to fix a single part."""
    (part,) = parts
    return Step(f"place {part}", PICK_PLACE, parts) if part in scene.product.parts else None


PICK_PLACE = Operation(
    name="pick_place",
    carry_out=carry_out,
    measure=measure,
    limits=LIMITS,
    role=Role.FIX,
    plan=plan,
    foresee=foresee,
)
