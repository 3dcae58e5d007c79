"""Operation rest: a part from above onto or into one on the fixture, where nothing guides it."""

from cell.products.joints import Rest
from planning.operations.operation import Operation, Role, Scene, Step
from planning.operations.rest.limits import LIMITS
from planning.operations.rest.measures import measure
from planning.operations.rest.phases import carry_out, foresee


def plan(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to bring a single part that rests on what stands there."""
    for joint in scene.product.joints:
        if isinstance(joint, Rest) and parts == (joint.part,) and joint.on in scene.standing:
            return Step(f"rest {joint.part}", REST, parts, joint, riders)
    return None


REST = Operation(
    name="rest",
    carry_out=carry_out,
    measure=measure,
    limits=LIMITS,
    role=Role.BRING,
    joint=Rest,
    coarse=True,
    plan=plan,
    foresee=foresee,
)
