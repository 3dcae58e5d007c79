"""Evaluation of one candidate on the soft jig: the tests, cheapest first, then the scores."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from cell.vectors import rotation_with_up
from planning.feasibility.directions import axis_index, unit_vector
from planning.feasibility.solids import combined_cog
from planning.fixture_analysis.candidate import Judged, Proposal
from planning.fixture_analysis.footprint import USUAL_DEPTH, Footprint, footprint, standing_points
from planning.fixture_analysis.held_body import GRAVITY, HeldBody
from planning.fixture_analysis.imprint import Imprint, depth_in_bed
from planning.fixture_analysis.loads import OperationLoad, operation_load
from planning.fixture_analysis.margins import Margin, margin_by_formula, margin_by_map
from planning.fixture_analysis.shared_analysis import SharedAnalysis

BED_YIELDS = 0.001  # [m] [A] One bead: less overlap than that is within bed compliance and grid.
MAX_EXCESS = 0.05  # [A] Share of the imprint's volume that the bed may fail to take up: less than
# the change of its own packing.


class Rejected(Exception):
    """A candidate fails a test; the message says why."""


class Evaluation:
    """One candidate under evaluation, with its figures and notes so far."""

    def __init__(self, shared: SharedAnalysis, proposal: Proposal, mapped: bool) -> None:
        self.shared, self.proposal, self.mapped = shared, proposal, mapped
        self.solids, self.setup = shared.matrices.solids, shared.setup
        self.R_JA = rotation_with_up(proposal.up).matrix()
        self.figures: dict[str, float] = {}
        self.notes: list[str] = []

    @cached_property
    def p_middle(self) -> np.ndarray:
        """Point (2,) of the body, turned, over the middle of the bag [m].

        It is the centre of gravity, rounded to a millimetre so that growing bodies share imprints.
        """
        return np.round((self.R_JA @ combined_cog(self.solids, self.proposal.body))[:2], 3) + 0.0

    @cached_property
    def low(self) -> float:
        """Height of the body's lowest point, turned [m]."""
        return self.shared.lowest(self.proposal.body, self.R_JA)

    def scores(self) -> dict[str, float]:
        """Return the scores, filling in figures and notes.

        Raises:
            Rejected: A test fails.
        """
        self._check_approach()
        self._check_connected()
        width = self._grip_width()
        diameter = self._footprint_diameter()
        self._check_balance()
        imprint = self._imprint()
        self._check_clearance(imprint)
        tilt = self._tilt(imprint.contact, -self.p_middle)
        margin = self._holding_margin(self._margin(imprint))
        bag = self.setup.jig.bag
        return {
            "reach": (1.0 + max(0.0, self.proposal.rise)) / 2.0,
            "stability": tilt / (np.pi / 2),
            "footprint": 1.0 - diameter / (2 * bag.aperture_radius),
            "imprint": 1.0 - imprint.depth / (bag.cap_height - bag.floor),
            "holding": margin / (1.0 + margin),
            "gripper": max(0.0, 1.0 - width / self.setup.gripper_stroke),
            "continuity": float(self.proposal.held or self.proposal.empty),
        }

    def _check_approach(self) -> None:
        if self.proposal.approach == "below":
            raise Rejected("the moved parts would have to come from below, through the jig")

    def _check_connected(self) -> None:
        support, body, moved = self.shared.support, self.proposal.body, self.proposal.moved
        pieces = len(support.components(body))
        if pieces > 1:
            raise Rejected(f"its {pieces} pieces are not connected: there is no one body to fix")
        if fallen := support.falling(body, self.proposal.up):
            raise Rejected(f"{_listed(fallen)} would fall off it")
        if dropped := support.dropped(moved, self.proposal.up):
            raise Rejected(f"{_listed(dropped)} would drop out of the moved parts")

    def _grip_width(self) -> float:
        """Return the largest width that must be gripped [m]."""
        bodies = self.shared.support.components(self.proposal.moved)
        widths = []
        for parts in bodies + ([] if self.proposal.held else [self.proposal.body]):
            width, obstacle = self.shared.grip.width(parts, self.R_JA)
            if obstacle:
                raise Rejected(f"{_listed(parts)} cannot be gripped in this posture: {obstacle}")
            widths.append(width)
        self.figures["grip_width_m"] = max(widths)
        return max(widths)

    def _footprint_diameter(self) -> float:
        """Return the diameter of the circle around the footprint [m]."""
        reach, lowest = self.low + USUAL_DEPTH, self.shared.lowest
        low = [name for name in self.proposal.body if lowest((name,), self.R_JA) <= reach]
        turned = (self.solids[name].vertices @ self.R_JA.T for name in low)
        outline = footprint(standing_points(turned))
        diameter = 0.0 if outline is None else outline.circle[1]
        self.figures["footprint_diameter_m"] = diameter
        aperture = 2 * self.setup.jig.bag.aperture_radius
        if diameter > aperture:
            raise Rejected(
                f"its footprint is {1e3 * diameter:.1f} mm across, the bag's aperture "
                f"{1e3 * aperture:.1f} mm"
            )
        return diameter

    def _check_balance(self) -> None:
        """Reject a body whose bounding box, seen from above, the common CoG is outside of."""
        solids = [self.solids[name] for name in self.proposal.body]
        low = np.min([solid.lower for solid in solids], axis=0)
        high = np.max([solid.upper for solid in solids], axis=0)
        p_G = combined_cog(self.solids, self.proposal.body + self.proposal.moved)
        beyond = np.delete(np.maximum(low - p_G, p_G - high), axis_index(self.proposal.up)).max()
        if beyond > 0.0:
            raise Rejected(f"the common centre of gravity is {1e3 * beyond:.1f} mm outside of it")

    def _imprint(self) -> Imprint:
        """Press the body into the bed."""
        up, press_force = self.proposal.up, self.setup.press_force
        imprint = self.shared.imprint(self.proposal.body, up, self.R_JA, self.p_middle)
        self.figures |= {"depth_m": imprint.depth, "imprint_volume_m3": imprint.volume}
        if imprint.force < press_force:
            raise Rejected(f"it sinks to the base plate before the bed bears {press_force:g} N")
        if imprint.excess > MAX_EXCESS * imprint.volume:
            raise Rejected(
                f"the bed around it cannot take up {1e6 * imprint.excess:.1f} of the "
                f"{1e6 * imprint.volume:.1f} cm3 of beads that it displaces"
            )
        return imprint

    def _check_clearance(self, imprint: Imprint) -> None:
        """Reject moved parts that end inside the frozen bed; a loose bolt may protrude instead."""
        protruding: dict[str, float] = {}
        for name in self.proposal.moved:
            lowest = self.shared.lowest((name,), self.R_JA)
            if lowest > self.low + self.setup.jig.bag.cap_height:
                continue
            surface = self.shared.surface(name)
            depth = depth_in_bed(imprint, surface, self.R_JA, self.p_middle, self.low)
            if depth <= BED_YIELDS:
                continue
            if self.proposal.rise < 1.0 or depth > self._engagement(name):
                raise Rejected(f"{name} would end {1e3 * depth:.0f} mm inside the frozen bed")
            protruding[name] = depth
        if protruding:
            most = 1e3 * max(protruding.values())
            self.notes.append(
                f"inserted loosely, {_listed(list(protruding))} may protrude by up to {most:.1f} "
                "mm from the seat: the frozen bed is below"
            )

    def _engagement(self, name: str) -> float:
        """Return how far a bolt that is only inserted may protrude and still be in its hole [m]."""
        screw, body = self.shared.product.screws.get(name), self.proposal.body
        if screw is None or screw.into in body or screw.clamps not in body:
            return 0.0
        axis = unit_vector(self.proposal.up)
        bolt, held = (self.solids[n].vertices @ axis for n in (name, screw.clamps))
        return float(min(bolt.max(), held.max()) - max(bolt.min(), held.min()))

    def _tilt(self, outline: Footprint | None, shift: np.ndarray) -> float:
        """Return the angle of tilt at which the body, alone or combined, tips over [rad].

        Args:
            outline: Of what supports it; None: nothing does.
            shift: (2,) from the turned product frame to the outline's [m].
        """
        angles = []
        body, both = self.proposal.body, self.proposal.body + self.proposal.moved
        for names, what in ((body, "body"), (both, "both")):
            p_G = self.R_JA @ combined_cog(self.solids, names)
            inside = -np.inf if outline is None else outline.margin(p_G[:2] + shift)
            self.figures[f"cog_height_{what}_m"] = float(p_G[2]) - self.low
            if inside <= 0.0:
                of = "its centre of gravity" if what == "body" else "the common centre of gravity"
                outside = max(0.0, -1e3 * inside)
                raise Rejected(f"{of} is {outside:.1f} mm outside its support area")
            angles.append(np.arctan2(inside, p_G[2] - self.low))
        self.figures["lean_angle_rad"] = float(min(angles))
        return self.figures["lean_angle_rad"]

    def _holding_margin(self, margin: Margin) -> float:
        """Return the sideways force that the body withstands, per force of the operation."""
        load, capacity = margin.load, margin.across * margin.load.sideways
        self.figures |= {"bears_across_N": capacity, "pushed_across_N": load.sideways}
        across = (
            f"withstands {capacity:.1f} N sideways at that height, the operation may exert "
            f"{load.sideways:.1f} N"
        )
        if load.torque:
            self.figures |= {
                "bears_turning_N_m": margin.turning * load.torque,
                "turned_N_m": load.torque,
            }
        if margin.turning < 1.0:
            # The hand that takes the torque has gripped the body, and takes a sideways force too.
            self.notes.append(
                f"a counter-hold against {load.torque:.2f} N m is needed: the fixture withstands "
                f"{margin.turning * load.torque:.2f} N m"
                + (f"; it {across}" if margin.across < 1.0 else "")
            )
        elif margin.across < 1.0:
            raise Rejected(f"it {across}")
        if self.mapped:
            self.notes.append(
                f"by the holding map it bears {margin.across:.1f} times the load of the operation"
                + (f"; first: {margin.criterion}" if margin.criterion else " or more")
            )
        return margin.across

    def _loads(self) -> list[OperationLoad]:
        """Return the loads of the coming operation, of each piece that is brought."""
        return [
            operation_load(
                self.shared.product,
                self.solids,
                self.setup,
                self.proposal,
                piece,
                self.p_middle,
                self.low,
            )
            for piece in self.shared.support.components(self.proposal.moved)
        ]

    def _margin(self, imprint: Imprint) -> Margin:
        """Return how often the body bears the loads, by the formula or by the map."""
        body, shared = self.proposal.body, self.shared
        if self.mapped:
            held = shared.frozen(body, self.proposal.up, self.R_JA, self.p_middle)
            return self._margin_on(held)
        p_G = (self.R_JA @ combined_cog(self.solids, body))[:2] - self.p_middle
        weight = GRAVITY * sum(self.solids[name].mass for name in body)
        return margin_by_formula(imprint, self.setup.jig, weight, p_G, self._loads())

    def _margin_on(self, held: HeldBody) -> Margin:
        """Return how often the body, held by a fixture, bears the loads by the map."""
        p_JMiddle = held.p_JA + [*self.p_middle, self.low]
        margin = margin_by_map(held, p_JMiddle, self._loads())
        if margin.load.pressed:
            self.figures |= {
                "bears_down_N": margin.across * margin.load.down,
                "pressed_down_N": margin.load.down,
            }
        self.shared.judged[self.proposal.key] = Judged(held, margin.cases)
        return margin


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} others"
