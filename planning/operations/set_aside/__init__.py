"""Operation set_aside: what stands on the fixture goes back to where its lowest part came from."""

from planning.operations.operation import Operation, Role, Scene, Step
from planning.operations.set_aside.limits import LIMITS
from planning.operations.set_aside.measures import measure
from planning.operations.set_aside.phases import carry_out


def plan(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to take a part off, with what rides on it."""
    (part,) = parts
    return Step(f"set aside {part}", SET_ASIDE, parts, riders=riders)


SET_ASIDE = Operation(
    name="set_aside",
    carry_out=carry_out,
    measure=measure,
    limits=LIMITS,
    role=Role.REMOVE,
    coarse=True,
    plan=plan,
)
