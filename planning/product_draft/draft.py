"""From parts in assembled poses to a folder with everything that a run needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from cell.cad.contact_model import ContactModel
from cell.cad.round_features import cylinders_of
from cell.configuration.config import CellConfig
from cell.errors import InputError, RunFailure
from cell.machines.grippers import GRIPPER_MODELS
from cell.machines.grippers.pads import grip_for
from cell.products.joints import Joint, Press
from cell.products.materials import (
    DEFAULT_MATERIAL,
    DENSITIES,
    FASTENER_MATERIAL,
    material_in,
    material_named,
)
from cell.products.product import Product
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import FixingPlan, plan
from planning.feasibility.directions import unit_vector
from planning.fixture_analysis.candidate import FixtureSetup
from planning.product_draft.bed_reach import bed_reach
from planning.product_draft.contact_models import contact_models
from planning.product_draft.grasps import part_grasps, screw_grasp
from planning.product_draft.guess import Guess
from planning.product_draft.hand_shape import HandShape
from planning.product_draft.joint_guesses import ScrewGuess, guess_fits, guess_screws
from planning.product_draft.joints import Joining
from planning.product_draft.part_models import plain, write_parts, write_tray
from planning.product_draft.recognised import Recognised, placed
from planning.product_draft.unknown_screws import unknown_screws


@dataclass(frozen=True)
class DraftOptions:
    """What a person knows and CAD does not say.

    Attributes:
        materials: By name of a part; "" for all that are not named.
        strength: Class of the screws.
        torque: Of all screws [N m]; None for the lower of what the class and the driver give.
        order: Items in the order of assembly; None for the best one.
        config: The cell.
    """

    materials: Mapping[str, str] = field(default_factory=dict)
    strength: str = "8.8"
    torque: float | None = None
    order: tuple[str, ...] | None = None
    config: CellConfig = field(default_factory=CellConfig)


@dataclass(frozen=True)
class Draft:
    """A product that can be run, with the guesses that made it.

    Attributes:
        product: With models, places in the tray, grasps and joints.
        base: Name of the part that the fixture holds.
        contacts: By name of a part, its contact model.
        guesses: All that CAD does not say.
    """

    product: Product
    base: str
    contacts: Mapping[str, ContactModel]
    guesses: tuple[Guess, ...]


def draft_product(product: Product, folder: Path, options: DraftOptions) -> Draft:
    """Guess what a run needs to know of a product, and write its models and its tray.

    Args:
        product: Parts in assembled poses, as `load_product` reads CAD.
        folder: Where models are written, in ``models``.
        options: What a person knows.

    Raises:
        RunFailure: There is no order in which the parts can be assembled on one fixed part.
        InputError: The parts cannot be used, or the tray is too small for them.
    """
    meshes = {name: placed(part) for name, part in product.parts.items()}
    features = {name: cylinders_of(mesh) for name, mesh in meshes.items()}
    screws, guesses = guess_screws(features)
    fits, more = guess_fits(features, screws)
    guesses += more
    materials = _materials(list(meshes), {s.part for s in screws}, options.materials, guesses)
    masses = {n: DENSITIES[materials[n]] * float(mesh.volume) for n, mesh in meshes.items()}
    parts = {n: replace(part, mass=masses[n]) for n, part in product.parts.items()}
    grouped = replace(product, parts=parts, groups={**product.groups, **_screw_groups(screws)})
    fixing = _planned(grouped, {s.part for s in screws}, options, guesses)
    place = {n: k for k, item in enumerate(fixing.order) for n in grouped.members(item)}
    base = fixing.steps[0].fixed_part
    seen = Recognised(meshes, features, screws, fits, materials, place, base)
    contacts, more = contact_models(seen)
    guesses += more
    modelled = write_parts(grouped, seen, contacts, folder)
    nests = write_tray(grouped, seen, folder)
    waiting = {name: replace(part, X_TrayP=nests[name][0]) for name, part in modelled.items()}
    joining = Joining(seen, fixing, product.up, contacts, options.strength, options.torque)
    joints = tuple(joining.joints())
    pushed = _grip_forces(joints, place, options.config)
    gripped = {}
    hand = _hand(options.config)
    imprint = bed_reach(meshes[base], product.up, FixtureSetup.of(options.config))
    for name, part in waiting.items():
        if name in seen.screw_named:
            gripped[name] = replace(part, grasps=(screw_grasp(seen.screw_named[name]),))
            continue
        own = [screw for screw in screws if name in (screw.clamps, screw.into)]
        there = set().union(*(seen.before(screw.part) for screw in own)) - {name}
        grasps, more = part_grasps(
            part,
            hand,
            unit_vector(product.up),
            base=meshes[base],
            earlier={other: meshes[other] for other in sorted(seen.before(name))},
            nest=nests[name][1],
            imprint=imprint,
            screws=own,
            beside={other: meshes[other] for other in sorted(there - set(seen.screw_named))},
            apart=options.config.motion.arm_clearance,
            wanted=pushed.get(name, 0.0),
        )
        guesses += more
        gripped[name] = replace(part, grasps=tuple(grasps))
    drafted = replace(
        grouped,
        parts=gripped,
        orders=(fixing.order,),
        joints=joints,
        tray=f"{plain(product.name)}_tray",
    )
    return Draft(drafted, base, contacts, (*guesses, *joining.guesses))


def _materials(
    names: list[str], screws: set[str], given: Mapping[str, str], guesses: list[Guess]
) -> dict[str, str]:
    """Return materials by name of the part, and add what is said of them."""
    for name in given:
        if name and name not in names:
            raise InputError(f"--material {name}=...: no such part; {', '.join(names)}.")
    usual, found = given.get(""), {}
    for name in names:
        said = material_in(name)
        if name in given:
            material, reason, sure = given[name], "given", 1.0
        elif said:
            material, reason, sure = said, "its name says so", 0.9
        elif name in screws:
            material, reason, sure = FASTENER_MATERIAL, "screws usually are", 0.9
        else:
            material, reason = usual or DEFAULT_MATERIAL, "given" if usual else "unknown"
            sure = 1.0 if usual else 0.4
        material = material_named(material)
        if sure < 1.0:
            guesses.append(Guess(name, material, reason, sure))
        found[name] = material
    return found


def _screw_groups(screws: list[ScrewGuess]) -> dict[str, tuple[str, ...]]:
    """Return equal screws that clamp the same parts as groups."""
    alike: dict[tuple[object, ...], list[str]] = {}
    for screw in screws:
        key = (screw.into, screw.clamps, screw.size.name, round(1e4 * screw.length))
        alike.setdefault(key, []).append(screw.part)
    return {
        "screws" if number == 0 else f"screws_{number + 1}": tuple(names)
        for number, names in enumerate(alike.values())
    }


def _planned(
    product: Product, screws: set[str], options: DraftOptions, guesses: list[Guess]
) -> FixingPlan:
    """Return the plan of the best order in which one part stays fixed.

    Raises:
        RunFailure: There is none.
    """
    best = plan(product, options.order, config=options.config)
    unknown = unknown_screws(best, screws)
    guesses += [Guess(name, "not taken for a screw", text, 0.7) for name, text in unknown.items()]
    # The cause comes first: the rest may be cut off.
    hints = "".join(f"{name}: {text}. " for name, text in unknown.items())
    if best.stop is not None or best.unplanned:
        reason = "; ".join(f"{item.name} {item.reason}" for item in best.unplanned)
        reason = stop_text(best) if best.stop else reason
        raise RunFailure(f"{hints}No order to assemble '{product.name}': {reason}.")
    others = best.orders.ranked if best.orders and options.order is None else ()
    for order in (best.order, *(r.order for r in others if r.refixings == 0)):
        found = best if order == best.order else plan(product, order, config=options.config)
        fixed = {step.fixed_part for step in found.steps}
        if len(fixed) == 1 and fixed <= set(product.parts) - screws:
            what = f"order {', '.join(order)}; '{min(fixed)}' is fixed"
            why = "given" if options.order else "the best one that fixes one part"
            guesses.append(Guess(product.name, what, why, 0.8))
            return found
    names = ", then ".join(dict.fromkeys(step.fixed_part for step in best.steps))
    raise RunFailure(
        f"{hints}Every order of '{product.name}' fixes more than one part, the best {names}: "
        "contact models are made for one. --order A,B,C asks for another order."
    )


def _grip_forces(
    joints: Sequence[Joint], place: Mapping[str, int], config: CellConfig
) -> dict[str, float]:
    """Return the grip force per pad that parts want which are pressed in, by their names [N]."""
    presses = [joint for joint in joints if isinstance(joint, Press)]
    brought = [max(joint.parts, key=lambda name: place[name]) for joint in presses]
    # Until the seat is felt: see `planning.operations.press`.
    forces = [grip_for(joint.force + config.insertion.force_limit) for joint in presses]
    return dict(zip(brought, forces, strict=True))


def _hand(config: CellConfig) -> HandShape:
    """Return the hand of the first arm that carries a gripper."""
    for arm in config.arms.values():
        if arm.tool in GRIPPER_MODELS:
            return HandShape(GRIPPER_MODELS[arm.tool])
    raise InputError(f"No arm carries a gripper: {', '.join(GRIPPER_MODELS)}.")
