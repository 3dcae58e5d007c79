"""Operation tighten_bolts: bolts that stand on their threads, driven home in star order."""

from cell.products.joints import Screw
from planning.operations.operation import Operation, Role, Scene, Step
from planning.operations.tighten_bolts.limits import LIMITS
from planning.operations.tighten_bolts.measures import measure
from planning.operations.tighten_bolts.phases import carry_out, foresee
from planning.operations.tighten_bolts.plots import plots


def plan(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to tighten every bolt that is there, with its thread, and not tightened yet."""
    screws = scene.product.screws
    ready = tuple(
        name
        for name in scene.standing
        if name in screws and screws[name].into in scene.standing and name not in scene.finished
    )
    return Step("tighten bolts", TIGHTEN_BOLTS, ready) if ready else None


TIGHTEN_BOLTS = Operation(
    name="tighten_bolts",
    carry_out=carry_out,
    measure=measure,
    limits=LIMITS,
    plots=plots,
    role=Role.FINISH,
    joint=Screw,
    plan=plan,
    foresee=foresee,
)
