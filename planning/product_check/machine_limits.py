"""What a product asks of hand, arm and driver against what those can give."""

from __future__ import annotations

from collections.abc import Iterator

from cell.configuration.config import CellConfig
from cell.errors import UnknownName
from cell.machines.arms import arm_model
from cell.machines.driver import largest_torque
from cell.machines.grippers import GRIPPER_MODELS, GripperModel
from cell.products.drives import BITS
from cell.products.product import Part, Product
from planning.feasibility.directions import unit_vector
from planning.product_check.finding import Finding, doubtful, fails, good
from planning.product_draft.hand_shape import HandShape
from planning.product_draft.no_grasp import why_no_grasp

LEAST_ROOM = 5e-4  # [A] The jaws open this much wider than the part at least, on both sides [m].
DENSEST, LIGHTEST = 22600.0, 20.0  # [kg/m3] Osmium; foam.


def machine_findings(product: Product, config: CellConfig) -> Iterator[Finding]:
    """Yield findings on masses, grasps and torques."""
    gripper, payload = _holder(config)
    for part in product.parts.values():
        yield from _mass(part, gripper, payload)
        yield from _grasps(part, gripper, product.up)
    yield from _screws(product, config)
    yield from _bits(product)


def _holder(config: CellConfig) -> tuple[GripperModel, float]:
    """Return the gripper, and what its arm carries besides [kg].

    Raises:
        UnknownName: No arm carries a gripper.
    """
    for arm in config.arms.values():
        if arm.tool in GRIPPER_MODELS:
            gripper = GRIPPER_MODELS[arm.tool]
            own = gripper.palm_mass + 2 * gripper.finger_mass
            return gripper, arm_model(arm.model).payload - own
    raise UnknownName("gripper on", "an arm", GRIPPER_MODELS)


def _mass(part: Part, gripper: GripperModel, payload: float) -> Iterator[Finding]:
    if part.mass > payload:
        text = f"{part.mass:.3g} kg, and the arm carries {payload:.3g} kg besides {gripper.name}"
        yield fails(part.name, text)
    volume = float(part.mesh.volume)
    if not LIGHTEST < part.mass / volume < DENSEST:
        text = f"{part.mass:.3g} kg in {1e6 * volume:.3g} cm3 is no material: wrong units?"
        yield doubtful(part.name, text)


def _grasps(part: Part, gripper: GripperModel, up: str) -> Iterator[Finding]:
    if not part.grasps:
        yield fails(part.name, f"it has no grasp; {_why_no_grasp(part, gripper, up)}")
        return
    usable = 0
    for grasp in part.grasps:
        setback = gripper.setback[grasp.jaw]
        least, most = setback, setback + gripper.stroke - 2 * LEAST_ROOM
        if not least < grasp.width <= most:
            yield doubtful(
                part.name,
                f"grasp '{grasp.name}' is {1e3 * grasp.width:.4g} mm wide; jaw '{grasp.jaw}' of "
                f"{gripper.name} grips {1e3 * least:.3g} to {1e3 * most:.3g} mm",
            )
        elif 2 * grasp.force > gripper.effort:
            yield doubtful(
                part.name,
                f"grasp '{grasp.name}' presses with {grasp.force:g} N; {gripper.name} has "
                f"{gripper.effort / 2:g} N per pad",
            )
        else:
            usable += 1
    if not usable:
        yield fails(part.name, f"none of its grasps suits {gripper.name}")


def _why_no_grasp(part: Part, gripper: GripperModel, up: str) -> str:
    """Return what is known without what is around: `soft-jig init` knows that."""
    mesh = part.mesh.copy()
    mesh.apply_transform(part.X_AP.GetAsMatrix4())
    alone = why_no_grasp(mesh, part.mass, HandShape(gripper), unit_vector(up), {})
    around = "jaws fit it, but not beside what is around it in the tray or where it goes"
    return alone or f"{around}: soft-jig init says what; give it one in the product file"


def _screws(product: Product, config: CellConfig) -> Iterator[Finding]:
    speed = config.driver.seat_speed
    asked: dict[tuple[float, float], list[str]] = {}
    for name, screw in product.screws.items():
        asked.setdefault((screw.torque, screw.diameter), []).append(name)
    for (torque, diameter), names in asked.items():
        subject = ", ".join(names)
        most = largest_torque(speed, diameter)
        if torque > most:
            yield fails(
                subject,
                f"{torque:.3g} N m, and the driver gives {most:.3g} at driver.seat_speed = "
                f"{speed:g} rad/s",
            )
        else:
            yield good(subject, f"{torque:.3g} N m of the {most:.3g} that the driver gives")


def _bits(product: Product) -> Iterator[Finding]:
    """Yield findings on what turns the screws; each drive needs its own bit."""
    turned: dict[str, list[str]] = {}
    for name, screw in product.screws.items():
        turned.setdefault(screw.drive.name, []).append(name)
        if not screw.drive.has_bit:
            yield fails(name, f"no bit fits '{screw.drive.name}'; there are {', '.join(BITS)}")
    if len(turned) > 1:
        bits = "; ".join(f"{drive} for {', '.join(names)}" for drive, names in turned.items())
        yield doubtful("driver", f"it changes no bits, and a run takes them as changed: {bits}")
