"""Operation press: from above, a shaft pushed into a hole with interference, or a hole onto one."""

from cell.products.joints import Press
from planning.operations.operation import Operation, Role, Scene, Step
from planning.operations.press.limits import LIMITS
from planning.operations.press.measures import measure
from planning.operations.press.phases import carry_out, foresee
from planning.operations.press.plots import plots


def plan(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to bring a single part, if it is pressed together with one that stands there."""
    for joint in scene.product.presses:
        shaft_comes = scene.product.enters_from_above(joint)
        part, on = (joint.shaft, joint.hole) if shaft_comes else (joint.hole, joint.shaft)
        if parts == (part,) and on in scene.standing:
            return Step(f"press {part}", PRESS, parts, joint, riders)
    return None


PRESS = Operation(
    name="press",
    carry_out=carry_out,
    measure=measure,
    limits=LIMITS,
    plots=plots,
    role=Role.BRING,
    joint=Press,
    plan=plan,
    foresee=foresee,
)
