"""From parts in assembled poses to a folder with everything that a run needs."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Manifold
from pydrake.math import RigidTransform, RotationMatrix

from cell.cad.contact_model import ContactModel, Use, contact_model
from cell.cad.convex_pieces import to_manifold
from cell.cad.nests import tray_model
from cell.cad.round_features import Cylinder, cylinders_of
from cell.cad.screw_model import screw_model
from cell.cad.sdf import Model, Visual, mesh_inertia, write_model
from cell.configuration.config import CellConfig
from cell.errors import InputError, RunFailure
from cell.machines.grippers import GRIPPER_MODELS
from cell.products.joints import Fit, Joint, Press, Rest, Screw
from cell.products.materials import (
    DEFAULT_MATERIAL,
    DENSITIES,
    FASTENER_MATERIAL,
    material_in,
    material_named,
)
from cell.products.model_files import OWN_MODELS
from cell.products.product import Part, Product
from cell.products.screw_table import NUT_FACTOR
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import FixingPlan, plan
from planning.feasibility.directions import rotation_with_up, unit_vector
from planning.product_draft.grasps import part_grasps, screw_grasp
from planning.product_draft.guess import Guess
from planning.product_draft.hand_shape import HandShape
from planning.product_draft.joint_guesses import (
    LINE_TO_LINE,
    SLIDING,
    FitGuess,
    ScrewGuess,
    guess_fits,
    guess_screws,
)
from planning.product_draft.tray_layout import SIZE, ScrewRow, lay_out

SOURCE = '"soft-jig init"'
DRIVER_TORQUE = 0.5  # [A] Of the driver: see `cell.machines.driver`, which stalls at 0.7 [N m].
PRESS_FORCE = 100.0  # [A] Where CAD says nothing [N].
COLORS = ((0.62, 0.70, 0.80), (0.80, 0.62, 0.25), (0.55, 0.56, 0.60), (0.42, 0.60, 0.45))


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
        seconds: Computing time by stage [s].
    """

    product: Product
    base: str
    contacts: Mapping[str, ContactModel]
    guesses: tuple[Guess, ...]
    seconds: Mapping[str, float]


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
    return _Drafting(product, folder, options).run()


@dataclass
class _Drafting:
    """One product on its way from CAD to a draft."""

    cad: Product
    folder: Path
    options: DraftOptions
    guesses: list[Guess] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    def run(self) -> Draft:
        """Return the draft."""
        started = time.process_time()
        self.meshes = {n: _placed(part) for n, part in self.cad.parts.items()}
        self.features = {n: cylinders_of(mesh) for n, mesh in self.meshes.items()}
        self.screws, said = guess_screws(self.features)
        self.fits, fits_said = guess_fits(self.features, self.screws)
        self.guesses += [*said, *fits_said]
        self.by_name = {screw.part: screw for screw in self.screws}
        self.density = self._densities()
        self.seconds["joints"] = time.process_time() - started
        started = time.process_time()
        grouped = self._grouped()
        self.plan = self._planned(grouped)
        self.base = self.plan.steps[0].fixed_part
        self.place = {n: k for k, i in enumerate(self.plan.order) for n in grouped.members(i)}
        self.seconds["order"] = time.process_time() - started
        started = time.process_time()
        self.contacts = self._contacts()
        parts = {n: self._modelled(n) for n in grouped.parts}
        self.seconds["contact models"] = time.process_time() - started
        started = time.process_time()
        parts = self._with_places(parts)
        self.seconds["tray"] = time.process_time() - started
        started = time.process_time()
        parts = self._with_grasps(parts)
        self.seconds["grasps"] = time.process_time() - started
        drafted = replace(
            grouped,
            parts=parts,
            orders=(self.plan.order,),
            joints=tuple(self._joints(grouped)),
            tray=f"{_plain(self.cad.name)}_tray",
        )
        return Draft(drafted, self.base, self.contacts, tuple(self.guesses), self.seconds)

    # Materials and order.

    def _densities(self) -> dict[str, float]:
        given = self.options.materials
        for name in given:
            if name and name not in self.meshes:
                raise InputError(f"--material {name}=...: no such part; {', '.join(self.meshes)}.")
        found = {}
        for name in self.meshes:
            said, screw, usual = material_in(name), name in self.by_name, given.get("")
            if name in given:
                material, reason, sure = given[name], "given", 1.0
            elif said:
                material, reason, sure = said, "its name says so", 0.9
            elif screw:
                material, reason, sure = FASTENER_MATERIAL, "screws usually are", 0.9
            else:
                material, reason = usual or DEFAULT_MATERIAL, "given" if usual else "unknown"
                sure = 1.0 if usual else 0.4
            material = material_named(material)
            if sure < 1.0:
                self.guesses.append(Guess(name, material, reason, sure))
            found[name] = DENSITIES[material]
        return found

    def _grouped(self) -> Product:
        """Return the product with masses, and with equal screws as groups."""
        parts = {
            n: replace(part, mass=self.density[n] * float(self.meshes[n].volume))
            for n, part in self.cad.parts.items()
        }
        alike: dict[tuple[object, ...], list[str]] = {}
        for screw in self.screws:
            key = (screw.into, screw.clamps, screw.size.name, round(1e4 * screw.length))
            alike.setdefault(key, []).append(screw.part)
        groups = dict(self.cad.groups)
        for number, names in enumerate(alike.values()):
            groups["screws" if number == 0 else f"screws_{number + 1}"] = tuple(names)
        return replace(self.cad, parts=parts, groups=groups)

    def _planned(self, product: Product) -> FixingPlan:
        """Return the plan of the best order in which one part stays fixed.

        Raises:
            RunFailure: There is none.
        """
        best = plan(product, self.options.order, config=self.options.config)
        if best.stop is not None or best.unplanned:
            reason = "; ".join(f"{item.name} {item.reason}" for item in best.unplanned)
            reason = stop_text(best) if best.stop else reason
            raise RunFailure(f"No order to assemble '{product.name}': {reason}")
        others = best.orders.ranked if best.orders and self.options.order is None else ()
        for order in (best.order, *(r.order for r in others if r.refixings == 0)):
            found = best if order == best.order else plan(product, order)
            fixed = {step.fixed_part for step in found.steps}
            if len(fixed) == 1 and fixed <= set(product.parts) - set(self.by_name):
                (base,) = fixed
                what = f"order {', '.join(order)}; '{base}' is fixed"
                why = "given" if self.options.order else "the best one that fixes one part"
                self.guesses.append(Guess(product.name, what, why, 0.8))
                return found
        fixed = ", then ".join(dict.fromkeys(step.fixed_part for step in best.steps))
        raise RunFailure(
            f"Every order of '{product.name}' fixes more than one part, the best {fixed}: contact "
            "models are made for one. --order A,B,C asks for another order."
        )

    # Contact models.

    def _contacts(self) -> dict[str, ContactModel]:
        uses: dict[str, dict[int, Use]] = {name: {} for name in self.meshes}
        for screw in self.screws:
            uses[screw.into][screw.thread_hole] = Use("thread")
            axis = self.features[screw.clamps][screw.clamped_hole].axis
            bearing = min(screw.head.bearing / 2e3, 0.47 * screw.head_size[0])
            uses[screw.clamps][screw.clamped_hole] = Use(
                "clearance", bearing=bearing, head_up=bool(axis @ screw.axis > 0.0)
            )
        for fit in self.fits:
            widened = SLIDING if abs(fit.clearance) < LINE_TO_LINE else 0.0
            uses[fit.hole][fit.hole_number] = Use("fit", fit.clearance + widened, widened=widened)
        solids = {name: to_manifold(mesh) for name, mesh in self.meshes.items()}
        found = {}
        for name, mesh in self.meshes.items():
            if name in self.by_name:
                continue
            for number, cylinder in enumerate(self.features[name]):
                others = [solid for other, solid in solids.items() if other != name]
                if number not in uses[name] and cylinder.hole and _is_used(cylinder, others):
                    uses[name][number] = Use("fit", 0.1 * cylinder.radius)
            model = contact_model(mesh, self.features[name], uses[name], fixed=name == self.base)
            error = model.error
            what = (
                f"contact model of {len(model.pieces)} pieces, "
                f"{100 * error.more:.2g} % more and {100 * error.less:.2g} % less volume, "
                f"at most {error.surface:.2g} mm beyond the surface"
            )
            good = error.more < 0.02 and error.surface < 0.3 and not model.notes
            reason = "; ".join(model.notes) or "cut along its concave edges"
            self.guesses.append(Guess(name, what, reason, 0.9 if good else 0.5))
            found[name] = model
        return found

    def _modelled(self, name: str) -> Part:
        """Write the model of a part; return the part with its name."""
        part = self.cad.parts[name]
        if name in self.by_name:
            return self._modelled_screw(self.by_name[name], part)
        mesh = self.meshes[name]
        mass = self.density[name] * float(mesh.volume)
        color = COLORS[self.place[name] % len(COLORS)]
        model = Model(
            _plain(name),
            mesh_inertia(mesh, mass, name),
            self.contacts[name].pieces,
            [Visual(_plain(name), mesh, color)],
            mesh,
        )
        write_model(self.folder / OWN_MODELS, model, SOURCE)
        return replace(part, mesh=mesh, mass=mass, X_AP=RigidTransform(), model=model.name)

    def _modelled_screw(self, screw: ScrewGuess, part: Part) -> Part:
        X_AP = RigidTransform(_upright(screw.axis), screw.p_AoP)
        mesh = self.meshes[screw.part].copy()
        mesh.apply_transform(X_AP.inverse().GetAsMatrix4())
        length = 1e3 * screw.length
        name = f"screw_{screw.size.name.lower().replace('.', '_')}x{length:.3g}".replace(".", "_")
        hole = self.features[screw.clamps][screw.clamped_hole]
        model = screw_model(
            name,
            mesh,
            diameter=screw.size.diameter,
            length=length,
            head=(1e3 * screw.head_size[0], 1e3 * screw.head_size[1]),
            bearing=min(screw.head.bearing / 2, 470.0 * screw.head_size[0]),
            hole=1e3 * hole.radius,
            density=self.density[screw.part],
        )
        write_model(self.folder / OWN_MODELS, model, SOURCE)
        return replace(part, mesh=mesh, mass=model.inertia.mass, X_AP=X_AP, model=name)

    # Tray and grasps.

    def _with_places(self, parts: Mapping[str, Part]) -> dict[str, Part]:
        """Write the tray; return the parts with their places in it."""
        R_TA = rotation_with_up(self.cad.up)
        solids = {n: self._turned(R_TA, n) for n in self._in_order() if n not in self.by_name}
        rows: dict[tuple[str, ...], ScrewRow] = {}
        for names in self._rows():
            screw = self.by_name[names[0]]
            rows[names] = ScrewRow(
                names, screw.size.diameter, 1e3 * screw.length, 1e3 * screw.head_size[0]
            )
        nests = lay_out(solids, list(rows.values()))
        model = tray_model(f"{_plain(self.cad.name)}_tray", nests, SIZE)
        write_model(self.folder / OWN_MODELS, model, SOURCE)
        self.nests = {nest.name: nest for nest in nests}
        placed = {}
        for name, part in parts.items():
            R = RotationMatrix() if name in self.by_name else R_TA
            X_TrayP = RigidTransform(R, 1e-3 * self.nests[name].p_TrayP)
            placed[name] = replace(part, X_TrayP=X_TrayP)
        return placed

    def _turned(self, R_TA: RotationMatrix, name: str) -> Manifold:
        mesh = self.meshes[name].copy()
        mesh.apply_transform(RigidTransform(R_TA, np.zeros(3)).GetAsMatrix4())
        return to_manifold(mesh.apply_scale(1e3))

    def _in_order(self) -> list[str]:
        return sorted(self.meshes, key=lambda name: self.place[name])

    def _rows(self) -> list[tuple[str, ...]]:
        alike: dict[str, list[str]] = {}
        for screw in self.screws:
            alike.setdefault(f"{screw.size.name} {screw.length:.4f}", []).append(screw.part)
        return [tuple(names) for names in alike.values()]

    def _with_grasps(self, parts: Mapping[str, Part]) -> dict[str, Part]:
        arms = self.options.config.arms.values()
        gripper = next(GRIPPER_MODELS[a.tool] for a in arms if a.tool in GRIPPER_MODELS)
        hand, up = HandShape(gripper), unit_vector(self.cad.up)
        done = dict(parts)
        for name, part in parts.items():
            if name in self.by_name:
                grasp = screw_grasp(self.by_name[name])
                done[name] = replace(part, grasps=(grasp,))
                continue
            earlier = {n: self.meshes[n] for n in self.meshes if self.place[n] < self.place[name]}
            grasps, guesses = part_grasps(
                part,
                hand,
                up,
                base=self.meshes[self.base],
                earlier=list(earlier.values()),
                nest=self.nests[name],
                screws=[screw for screw in self.screws if screw.clamps == name],
                apart=self.options.config.motion.arm_clearance,
            )
            self.guesses += guesses
            done[name] = replace(part, grasps=tuple(grasps))
        return done

    # Joints.

    def _joints(self, product: Product) -> list[Joint]:
        """Return screws, fits and, for what nothing else joins to an earlier part, rests."""
        joints: list[Joint] = []
        for name in self._in_order():
            if name in self.by_name:
                joints.append(self._screw(self.by_name[name]))
                continue
            earlier = {n for n in self.meshes if self.place[n] < self.place[name]}
            own = [
                fit
                for fit in self.fits
                if name in (fit.shaft, fit.hole) and {fit.shaft, fit.hole} - {name} <= earlier
            ]
            if own:
                joints.append(self._fit(max(own, key=lambda fit: fit.depth), name))
            elif name != self.base:
                joints.append(self._rest(name, earlier))
        return joints

    def _screw(self, screw: ScrewGuess) -> Screw:
        by_class = screw.size.preload_torque(self.options.strength, NUT_FACTOR)
        torque = self.options.torque or min(by_class, DRIVER_TORQUE)
        if self.options.torque is None:
            reason = f"class {self.options.strength} bears {by_class:.2g} N m"
            if by_class > DRIVER_TORQUE:
                reason += f", the driver gives {DRIVER_TORQUE:g}"
            what = f"tightened to {torque:.2g} N m with a {screw.head.drive} bit"
            self.guesses.append(Guess(screw.part, what, reason, 0.6))
        radius = self.contacts[screw.clamps].friction_radius[screw.clamped_hole]
        return Screw(
            part=screw.part,
            into=screw.into,
            clamps=screw.clamps,
            thread=screw.size.name,
            diameter=1e-3 * screw.size.diameter,
            pitch=1e-3 * screw.size.pitch,
            thread_depth=screw.thread_depth,
            torque=torque,
            nut_factor=NUT_FACTOR,
            friction_radius=radius,
        )

    def _fit(self, fit: FitGuess, later: str) -> Joint:
        """Return a fit with the mouth where the later of its two parts meets the other one."""
        up = unit_vector(self.cad.up)
        shaft = self.features[fit.shaft][fit.shaft_number]
        hole = self.features[fit.hole][fit.hole_number]
        shaft = shaft if shaft.axis @ up >= 0.0 else shaft.reversed()
        hole = hole if hole.axis @ up >= 0.0 else hole.reversed()
        if later == fit.hole:
            mouth = hole.flare_low[1]
            depth = shaft.flare_high[1] - mouth
        else:
            mouth = hole.flare_high[1]
            depth = mouth - shaft.flare_low[1]
        p_AoF = hole.point + mouth * hole.axis
        if fit.clearance < -LINE_TO_LINE:
            return Press(fit.shaft, fit.hole, p_AoF, depth, PRESS_FORCE)
        return Fit(fit.shaft, fit.hole, p_AoF, depth)

    def _rest(self, name: str, earlier: set[str]) -> Rest:
        names = self.plan.parts
        touch = self.plan.contact + self.plan.contact.T
        on = [n for n in names if n in earlier and touch[names.index(name), names.index(n)]]
        if not on:
            raise RunFailure(f"'{name}' touches nothing that is there before it.")
        # The lowest contact bears it.
        up = unit_vector(self.cad.up)
        bearer = max(on, key=lambda n: float((self.meshes[n].vertices @ up).max()))
        self.guesses.append(
            Guess(name, f"rests on {bearer}", "it touches it, and no shaft joins them", 0.8)
        )
        return Rest(name, bearer)


def _placed(part: Part) -> trimesh.Trimesh:
    """Return the surface of a part in the product frame."""
    mesh = part.mesh.copy()
    mesh.apply_transform(part.X_AP.GetAsMatrix4())
    return mesh


def _plain(name: str) -> str:
    """Return a name as files and URLs bear it."""
    return "".join(c if c.isalnum() or c in "_-" else "_" for c in name)


def _upright(axis: np.ndarray) -> RotationMatrix:
    """Return axes with z along a direction."""
    x = np.eye(3)[np.argmin(np.abs(axis))]
    x = x - axis * (axis @ x)
    x /= np.linalg.norm(x)
    return RotationMatrix(np.column_stack([x, np.cross(axis, x), axis]))


def _is_used(cylinder: Cylinder, others: list[Manifold]) -> bool:
    """Return whether other parts reach into a hole."""
    length = cylinder.length
    core = Manifold.cylinder(length, 0.9 * cylinder.radius, -1.0, 16)
    core = core.translate([0, 0, cylinder.low]).transform(cylinder.X[:3])
    return any((core ^ other).volume() > 0.01 * core.volume() for other in others)
