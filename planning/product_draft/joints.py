"""The joints of a drafted product: what holds each part to those that come before it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from manifold3d import Manifold

from cell.cad.contact_model import ContactModel
from cell.cad.convex_pieces import to_manifold
from cell.cad.round_features import Cylinder
from cell.errors import RunFailure
from cell.products.drives import Drive
from cell.products.joints import Fit, Joint, Press, Rest, Screw
from cell.products.press_force import Ring, press_force
from cell.products.screw_table import NUT_FACTOR
from planning.assembly_plan.planner import FixingPlan
from planning.feasibility.directions import unit_vector
from planning.product_draft.engagement import engagement
from planning.product_draft.guess import Guess
from planning.product_draft.joint_guesses import LINE_TO_LINE, FitGuess, ScrewGuess
from planning.product_draft.recognised import Recognised

DRIVER_TORQUE = 0.5  # [A] Of the driver: see `cell.machines.driver`, which stalls at 0.7 [N m].
# [A] Screws on one part from which they are tightened in two passes: three set its plane, and those
# that follow raise or relax the first; two pull it down evenly enough [M].
TWO_PASSES = 3


@dataclass
class Joining:
    """Makes the joints of a product.

    Attributes:
        seen: What is recognised.
        plan: Order and contact of its parts.
        up: Axis of A that points up.
        contacts: By name of a part, its contact model.
        strength: Class of the screws.
        torque: Of all screws [N m]; None for the lower of what the class and the driver give.
        guesses: What is said of them.
    """

    seen: Recognised
    plan: FixingPlan
    up: str
    contacts: Mapping[str, ContactModel]
    strength: str
    torque: float | None
    guesses: list[Guess] = field(default_factory=list)

    def joints(self) -> list[Joint]:
        """Return screws, fits and, for what nothing else joins to an earlier part, rests."""
        joints: list[Joint] = []
        screws = self.seen.screw_named
        for name in self.seen.in_order:
            if name in screws:
                joints.append(self._screw(screws[name]))
                continue
            earlier = self.seen.before(name)
            own = [
                fit
                for fit in self.seen.fits
                if name in (fit.shaft, fit.hole) and {fit.shaft, fit.hole} - {name} <= earlier
            ]
            if own:
                joints.append(self._fit(max(own, key=lambda fit: fit.depth), name))
            elif name != self.seen.base:
                joints.append(self._rest(name, earlier))
        return joints

    def _screw(self, screw: ScrewGuess) -> Screw:
        by_class = screw.size.preload_torque(self.strength, NUT_FACTOR)
        torque = self.torque or min(by_class, DRIVER_TORQUE)
        if self.torque is None:
            reason = f"class {self.strength} bears {by_class:.2g} N m"
            if by_class > DRIVER_TORQUE:
                reason += f", the driver gives {DRIVER_TORQUE:g}"
            what = f"tightened to {torque:.2g} N m with a {screw.head.drive} bit"
            self.guesses.append(Guess(screw.part, what, reason, 0.6))
        radius = self.contacts[screw.clamps].friction_radius[screw.clamped_hole]
        beside = [other for other in self.seen.screws if other.clamps == screw.clamps]
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
            drive=Drive(screw.head.drive),
            bit_seat=screw.head_size[1] - 1e-3 * screw.head.engagement,
            passes=2 if len(beside) >= TWO_PASSES else 1,
        )

    def _fit(self, fit: FitGuess, later: str) -> Joint:
        """Return a fit with the mouth where the later of its two parts meets the other one."""
        up = unit_vector(self.up)
        shaft = self.seen.features[fit.shaft][fit.shaft_number]
        hole = self.seen.features[fit.hole][fit.hole_number]
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
            return Press(fit.shaft, fit.hole, p_AoF, depth, self._press_force(fit, shaft, depth))
        return Fit(fit.shaft, fit.hole, p_AoF, depth)

    def _press_force(self, fit: FitGuess, shaft: Cylinder, depth: float) -> float:
        """Return the force that a press fit takes, with its parts taken for cylinders [N]."""
        materials, mesh = self.seen.materials, self.seen.meshes[fit.hole]
        bores = [
            other.radius
            for other in self.seen.features[fit.shaft]
            if other.hole and other.radius < shaft.radius and other.coaxial(shaft, 1e-4)
        ]
        # What is around the hole, as far as it goes to the side that is nearest.
        across = np.abs(np.asarray(mesh.bounds) - shaft.point)
        outer = float(across[:, np.abs(shaft.axis) < 0.5].min())
        force = press_force(
            Ring(materials[fit.shaft], max(bores, default=0.0), shaft.radius),
            Ring(materials[fit.hole], shaft.radius, outer),
            -fit.clearance,
            depth,
        )
        what = f"pressed into {fit.hole} with {float(f'{force:.2g}'):g} N"
        reason = f"{materials[fit.shaft]} in {materials[fit.hole]}, by Lame"
        self.guesses.append(Guess(fit.shaft, what, reason, 0.5))
        return force

    def _rest(self, name: str, earlier: set[str]) -> Rest:
        names = self.plan.parts
        touch = self.plan.contact + self.plan.contact.T
        on = [n for n in names if n in earlier and touch[names.index(name), names.index(n)]]
        if not on:
            raise RunFailure(f"'{name}' touches nothing that is there before it.")
        # The lowest contact bears it.
        up = unit_vector(self.up)
        bearer = max(on, key=lambda n: float((self.seen.meshes[n].vertices @ up).max()))
        solids = {n: to_manifold(self.seen.meshes[n]).scale([1e3] * 3) for n in (name, *earlier)}
        depth = engagement(solids.pop(name), sum(solids.values(), Manifold()), up)
        what = f"rests on {bearer}" + (f", guided over {depth:.2g} mm" if depth else "")
        self.guesses.append(Guess(name, what, "it touches it, and no shaft joins them", 0.8))
        return Rest(name, bearer, 1e-3 * depth)
