"""One candidate at a time: the tests, cheapest first, and the scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from planning.feasibility.algorithm import Geometry
from planning.feasibility.directions import axis_index, unit_vector
from planning.feasibility.solids import combined_cog
from planning.fixture_analysis.candidate import Candidate, Setup
from planning.fixture_analysis.capacity import PUSHES, Load, sideways_capacity, turning_capacity
from planning.fixture_analysis.footprint import footprint, posture, standing_points
from planning.fixture_analysis.gravity import Gravity
from planning.fixture_analysis.gripper import STROKE, Gripper
from planning.fixture_analysis.imprint import Imprint, Surface, depth_in_bed, press, samples_of

GRAVITY = 9.81  # [m/s2]
FIT_FRICTION = 0.3  # [A] Of metal on metal, dry, 0.2-0.5: how much of an insertion's force a part
# that has not found its hole exerts across.
BED_GIVES = 0.001  # [m] [A] One bead: less is within what the bed gives and the grid resolves.
ROOM_LOST = 0.05  # [A] Share of the imprint's volume that may find no room: below the bed's own
# change of packing.


class Rejected(Exception):
    """A candidate fails a test; the message says why."""


@dataclass(frozen=True)
class Trial:
    """A candidate before it is looked at.

    Attributes:
        name: Items on the jig, as words.
        body: Names of their parts.
        moved: Names of the parts that are brought to them.
        directions: Along which the moved parts leave the body.
        up: Axis of the product frame that points up.
        held: Whether the jig holds the body like this already.
        bare: Whether the jig holds nothing yet.
    """

    name: str
    body: tuple[str, ...]
    moved: tuple[str, ...]
    directions: Sequence[str]
    up: str
    held: bool
    bare: bool


class Examiner:
    """Examines candidates; keeps what several of them need."""

    def __init__(self, product: Product, geometry: Geometry, setup: Setup) -> None:
        self.product, self.geometry, self.setup = product, geometry, setup
        self.gravity, self.gripper = Gravity(product, geometry), Gripper(product, geometry)
        self._lows: dict[tuple[str, bytes], float] = {}
        self._samples: dict[str, Surface] = {}
        self._imprints: dict[tuple[tuple[str, ...], str, bytes], Imprint] = {}

    def examine(self, trial: Trial) -> Candidate:
        """Run the tests and return the candidate with figures, and scores or the reason."""
        figures: dict[str, float] = {}
        notes: list[str] = []
        approach = _approach(trial)
        scores: dict[str, float] = {}
        rejected = ""
        try:
            scores = self._scores(trial, approach, figures, notes)
        except Rejected as reason:
            rejected = str(reason)
        return Candidate(
            trial.name,
            trial.body,
            trial.moved,
            trial.up,
            approach,
            figures,
            scores,
            rejected,
            tuple(notes),
        )

    def _scores(
        self, trial: Trial, approach: str, figures: dict[str, float], notes: list[str]
    ) -> dict[str, float]:
        """Return the scores, noting the figures on the way; raises `Rejected`."""
        if approach == "below":
            raise Rejected("what is moved would have to come from below, through the jig")
        self._check_loose(trial)
        R_JA = posture(trial.up)
        width = self._grip(trial, R_JA, figures)
        diameter = self._footprint(trial, R_JA, figures)
        self._check_balance(trial)
        imprint = self._imprint(trial, R_JA, figures)
        self._check_clear_of_bed(trial, R_JA, approach, imprint, notes)
        lean = self._lean(trial, R_JA, imprint, figures)
        margin = self._holding(trial, R_JA, approach, imprint, figures, notes)
        bag = self.setup.jig.bag
        return {
            "reach": 1.0 if approach == "above" else 0.5,
            "stability": lean / (np.pi / 2),
            "footprint": 1.0 - diameter / (2 * bag.aperture_radius),
            "imprint": 1.0 - imprint.depth / (bag.cap_height - bag.floor),
            "holding": margin / (1.0 + margin),
            "gripper": max(0.0, 1.0 - width / STROKE),
            "continuity": float(trial.held or trial.bare),
        }

    def _check_loose(self, trial: Trial) -> None:
        pieces = len(self.gravity.components(trial.body))
        if pieces > 1:
            raise Rejected(f"its {pieces} pieces do not hang together: no one body to fix")
        if fallen := self.gravity.falling(trial.body, trial.up):
            raise Rejected(f"{_listed(fallen)} would fall off it")
        if dropped := self.gravity.dropped(trial.moved, trial.up):
            raise Rejected(f"{_listed(dropped)} would drop from what is moved")

    def _grip(self, trial: Trial, R_JA: np.ndarray, figures: dict[str, float]) -> float:
        """Return the largest width that must be gripped [m]."""
        bodies = self.gravity.components(trial.moved) + ([] if trial.held else [trial.body])
        widths = []
        for parts in bodies:
            width, obstacle = self.gripper.width(parts, R_JA)
            if obstacle:
                raise Rejected(f"no way to grip {_listed(parts)} in this posture: {obstacle}")
            widths.append(width)
        figures["grip_width_m"] = max(widths)
        return max(widths)

    def _footprint(self, trial: Trial, R_JA: np.ndarray, figures: dict[str, float]) -> float:
        """Return the diameter of the circle around the footprint [m]."""
        solids = [self.geometry.solids[name] for name in trial.body]
        outline = footprint(standing_points(solid.vertices @ R_JA.T for solid in solids))
        diameter = 0.0 if outline is None else outline.circle[1]
        figures["footprint_diameter_m"] = diameter
        aperture = 2 * self.setup.jig.bag.aperture_radius
        if diameter > aperture:
            raise Rejected(
                f"its footprint needs {1e3 * diameter:.1f} mm, the bag has {1e3 * aperture:.1f} mm"
            )
        return diameter

    def _check_balance(self, trial: Trial) -> None:
        """What is assembled beyond the body's own box tips it, however it stands in the bed."""
        solids = [self.geometry.solids[name] for name in trial.body]
        low = np.min([solid.lower for solid in solids], axis=0)
        high = np.max([solid.upper for solid in solids], axis=0)
        p_G = combined_cog(self.geometry.solids, trial.body + trial.moved)
        beyond = np.delete(np.maximum(low - p_G, p_G - high), axis_index(trial.up)).max()
        if beyond > 0.0:
            raise Rejected(f"the common centre of gravity is {1e3 * beyond:.1f} mm beside it")

    def _imprint(self, trial: Trial, R_JA: np.ndarray, figures: dict[str, float]) -> Imprint:
        """Press the body into the bed; what is added far above the bed changes nothing."""
        middle, low = self._place(trial, R_JA)
        reach = low + self.setup.jig.bag.cap_height
        reaching = tuple(n for n in trial.body if self._lowest((n,), R_JA) <= reach)
        key = reaching, trial.up, middle.tobytes()
        if key not in self._imprints:
            parts = [self._sampled(name) for name in reaching]
            self._imprints[key] = press(parts, R_JA, middle, self.setup.jig, self.setup.press_force)
        imprint = self._imprints[key]
        figures["depth_m"], figures["imprint_volume_m3"] = imprint.depth, imprint.volume
        if imprint.force < self.setup.press_force:
            raise Rejected(
                f"it sinks to the base plate before the bed bears {self.setup.press_force:g} N"
            )
        if imprint.homeless > ROOM_LOST * imprint.volume:
            raise Rejected(
                f"{1e6 * imprint.homeless:.1f} of the {1e6 * imprint.volume:.1f} cm3 of beads that "
                "it displaces find no room beside it"
            )
        return imprint

    def _check_clear_of_bed(
        self, trial: Trial, R_JA: np.ndarray, approach: str, imprint: Imprint, notes: list[str]
    ) -> None:
        """What is moved must end above the frozen bed; a loose bolt may stand proud of its seat."""
        middle, low = self._place(trial, R_JA)
        proud: dict[str, float] = {}
        for name in trial.moved:
            if self._lowest((name,), R_JA) > low + self.setup.jig.bag.cap_height:
                continue
            depth = depth_in_bed(imprint, self._sampled(name), R_JA, middle, low)
            if depth <= BED_GIVES:
                continue
            if approach != "above" or depth > self._engagement(trial, name):
                raise Rejected(f"{name} would end {1e3 * depth:.0f} mm inside the frozen bed")
            proud[name] = depth
        if proud:
            most = 1e3 * max(proud.values())
            notes.append(
                f"put in loose, {_listed(list(proud))} may stand up to {most:.1f} mm proud of the "
                "seat: the frozen bed is below"
            )

    def _engagement(self, trial: Trial, name: str) -> float:
        """Return how far a bolt that is only put in may stand out and still be in its hole [m]."""
        fastener = self.product.fasteners.get(name)
        if fastener is None or fastener.into in trial.body or fastener.clamps not in trial.body:
            return 0.0
        axis = unit_vector(trial.up)
        bolt, held = (self.geometry.solids[n].vertices @ axis for n in (name, fastener.clamps))
        return float(min(bolt.max(), held.max()) - max(bolt.min(), held.min()))

    def _place(self, trial: Trial, R_JA: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the point (2,) of the body over the middle of the bag, and its lowest height.

        That is its centre of gravity, to a millimetre, so that growing bodies share imprints.
        """
        middle = (R_JA @ combined_cog(self.geometry.solids, trial.body))[:2]
        return np.round(middle, 3) + 0.0, self._lowest(trial.body, R_JA)

    def _lowest(self, names: Sequence[str], R_JA: np.ndarray) -> float:
        key = R_JA.tobytes()
        for name in (name for name in names if (name, key) not in self._lows):
            vertices = self.geometry.solids[name].vertices
            self._lows[name, key] = float((vertices @ R_JA[2]).min())
        return min(self._lows[name, key] for name in names)

    def _sampled(self, name: str) -> Surface:
        if name not in self._samples:
            self._samples[name] = samples_of(self.geometry.solids[name])
        return self._samples[name]

    def _lean(
        self, trial: Trial, R_JA: np.ndarray, imprint: Imprint, figures: dict[str, float]
    ) -> float:
        """Return the angle by which the centre of gravity could lean, alone and combined [rad]."""
        leans = []
        middle, low = self._place(trial, R_JA)
        for names, what in ((trial.body, "body"), (trial.body + trial.moved, "both")):
            p_G = R_JA @ combined_cog(self.geometry.solids, names)
            outline = imprint.contact
            inside = -np.inf if outline is None else outline.margin(p_G[:2] - middle)
            figures[f"cog_height_{what}_m"] = float(p_G[2]) - low
            if inside <= 0.0:
                of = "its centre of gravity" if what == "body" else "the common centre of gravity"
                raise Rejected(f"{of} is {max(0.0, -1e3 * inside):.1f} mm beside what it stands on")
            leans.append(np.arctan2(inside, p_G[2] - low))
        figures["lean_angle_rad"] = float(min(leans))
        return figures["lean_angle_rad"]

    def _holding(
        self,
        trial: Trial,
        R_JA: np.ndarray,
        approach: str,
        imprint: Imprint,
        figures: dict[str, float],
        notes: list[str],
    ) -> float:
        """Return what the body bears across, per force that the operation exerts across."""
        solids, jig = self.geometry.solids, self.setup.jig
        p_G = (R_JA @ combined_cog(solids, trial.body))[:2] - self._place(trial, R_JA)[0]
        weight = GRAVITY * sum(solids[name].mass for name in trial.body)
        margins = []
        for piece in self.gravity.components(trial.moved):
            load = self._load(trial, piece, R_JA, approach)
            bears = sideways_capacity(imprint, jig, weight, p_G, load)
            margins.append((bears / load.sideways, bears, load))
        margin, bears, load = min(margins, key=lambda entry: entry[0])
        figures |= {"bears_across_N": bears, "pushed_across_N": load.sideways}
        if margin < 1.0:
            raise Rejected(
                f"it bears {bears:.1f} N across at that height, the operation may exert "
                f"{load.sideways:.1f} N"
            )
        turning = turning_capacity(imprint, jig, weight, load)
        if load.torque > turning:
            notes.append(
                f"hold it against {load.torque:.2f} N m: friction under it bears {turning:.2f} N m"
            )
        return margin

    def _load(self, trial: Trial, piece: tuple[str, ...], R_JA: np.ndarray, approach: str) -> Load:
        """Return what bringing one piece does to the body."""
        fasteners = [self.product.fasteners[n] for n in piece if n in self.product.fasteners]
        driven = len(fasteners) == len(piece) and all(f.into in trial.body for f in fasteners)
        force = self.setup.driver_force if driven else self.setup.insertion_force
        torque = max((f.torque for f in fasteners), default=0.0) if driven else 0.0
        p_JQ = R_JA @ self._mating_point(trial, piece)
        middle, low = self._place(trial, R_JA)
        p_Q, height = p_JQ[:2] - middle, max(float(p_JQ[2]) - low, 1e-3)
        if approach == "above":
            return Load(force, FIT_FRICTION * force, torque, p_Q, height)
        along = [-(R_JA @ unit_vector(j))[:2] for j in trial.directions if _is_across(j, trial.up)]
        pushes = tuple(p for p in PUSHES if any(p @ a > 0.5 for a in along))
        return Load(0.0, force, torque, p_Q, height, pushes)

    def _mating_point(self, trial: Trial, piece: tuple[str, ...]) -> np.ndarray:
        """Return where a piece meets the body (3,) in A: the mouth of their fit, if it is known.

        Otherwise the middle of the piece, as high as both reach.
        """
        for fit in self.product.fits:
            sides = {fit.shaft, fit.hole}
            if sides & set(piece) and sides & set(trial.body):
                return np.asarray(fit.p_AoF, float)
        axis = unit_vector(trial.up)
        solids = self.geometry.solids
        low = np.min([solids[name].lower for name in piece], axis=0)
        high = np.max([solids[name].upper for name in piece], axis=0)
        tops = [
            max(float((solids[name].vertices @ axis).max()) for name in names)
            for names in (piece, trial.body)
        ]
        middle = (low + high) / 2
        return middle + (min(tops) - middle @ axis) * axis


def _approach(trial: Trial) -> str:
    """Return where the moved parts come from, the best of the directions they may take."""
    if trial.up in trial.directions:
        return "above"
    return "the side" if any(_is_across(j, trial.up) for j in trial.directions) else "below"


def _is_across(direction: str, up: str) -> bool:
    return axis_index(direction) != axis_index(up)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} others"
