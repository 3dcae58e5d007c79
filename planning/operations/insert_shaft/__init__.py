"""Operation insert_shaft: from above, a hole onto a shaft on the fixture, or a shaft into one."""

from cell.products.joints import Fit
from planning.operations.insert_shaft.limits import LIMITS
from planning.operations.insert_shaft.measures import measure
from planning.operations.insert_shaft.phases import carry_out, foresee
from planning.operations.insert_shaft.plots import plots
from planning.operations.operation import Operation, Role, Scene, Step


def plan(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
    """Offer to bring a single part, if its hole fits a shaft that stands there, or the reverse."""
    for fit in scene.product.fits:
        if parts == (fit.hole,) and fit.shaft in scene.standing:
            return Step(f"insert {fit.hole}", INSERT_SHAFT, parts, fit, riders)
        if (
            parts == (fit.shaft,)
            and fit.hole in scene.standing
            and scene.product.enters_from_above(fit)
        ):
            return Step(f"insert {fit.shaft}", INSERT_SHAFT, parts, fit, riders)
    return None


INSERT_SHAFT = Operation(
    name="insert_shaft",
    carry_out=carry_out,
    measure=measure,
    limits=LIMITS,
    plots=plots,
    role=Role.BRING,
    joint=Fit,
    coarse=True,
    plan=plan,
    foresee=foresee,
)
