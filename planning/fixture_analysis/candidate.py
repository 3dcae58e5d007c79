"""The values of the general rule: its inputs, and its assessment of a candidate and of a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.fixtures import fixture_class
from cell.fixtures.soft_jig import JigParameters
from cell.machines.grippers import GRIPPER_MODELS
from planning.feasibility.directions import axis_index, unit_vector
from planning.fixture_analysis.held_body import HeldBody, LoadCase

STEEP = 0.7071  # Sine of 45 degrees, rounded down: what comes at 45 degrees comes from above.
LEVEL = 1e-3  # Sine of 0.06 degrees: horizontal within rounding.

CRITERIA: Mapping[str, str] = {
    "reach": "1 if the moved part comes from above, 1/2 from the side, between them at an angle",
    "stability": "angle by which the centre of gravity can tilt before it leaves the support area, "
    "of 90 degrees; the lower of the body alone and with the moved part on it",
    "footprint": "share of the bag's diameter that the footprint leaves free",
    "imprint": "share of the bag's depth that is left below the body",
    "holding": "m / (1 + m), m: sideways force it withstands, per sideways force of the operation",
    "gripper": "share of the gripper's stroke that is left at the largest grip width; 0 also for "
    "jaws made for more than the stroke",
    "continuity": "1 if the jig already holds the body in this posture, or holds nothing yet",
}
"""What the scores of a candidate mean, each from 0 to 1."""


@dataclass(frozen=True)
class FixtureSetup:
    """The parts of a cell's configuration that decide how well a body can be fixed.

    Attributes:
        jig: Bag, beads, vacuum, frozen bed.
        press_force: Force with which a body is pressed into the jig [N].
        insertion_force: Largest force along an insertion [N].
        driver_force: Thrust of the screwdriver [N].
        gripper_stroke: Largest opening of the gripper, or of the widest one [m].
        custom: The configuration, if its fixture is made for one part; None: the soft jig.
    """

    jig: JigParameters
    press_force: float
    insertion_force: float
    driver_force: float
    gripper_stroke: float
    custom: CellConfig | None = None

    @staticmethod
    def of(config: CellConfig) -> FixtureSetup:
        """Return the setup that a configuration describes.

        Raises:
            InputError: No arm carries a gripper.
        """
        tools = [arm.tool for arm in config.arms.values()]
        strokes = [GRIPPER_MODELS[tool].stroke for tool in tools if tool in GRIPPER_MODELS]
        if not strokes:
            known = ", ".join(GRIPPER_MODELS)
            raise InputError(f"No arm carries a gripper; set arms.NAME.tool to one of {known}.")
        return FixtureSetup(
            config.jig,
            config.placement.press_force,
            config.insertion.force_limit,
            config.driver.push_force,
            max(strokes),
            config if fixture_class(config.workcell.fixture).custom else None,
        )


@dataclass(frozen=True)
class Proposal:
    """One way to hold the product during a step, not evaluated yet.

    Attributes:
        name: Names of the items on the jig, as words.
        body: Names of their parts.
        moved: Names of the parts that are brought to them.
        directions: Along which the moved parts leave the body.
        up: Axis of the product frame that points up.
        held: Whether the jig already holds this body in this posture.
        empty: Whether the jig holds nothing yet.
        slanted: The same at an angle to the axes, (3,) unit vectors in A; they count only where
            none of the directions is open.
    """

    name: str
    body: tuple[str, ...]
    moved: tuple[str, ...]
    directions: Sequence[str]
    up: str
    held: bool
    empty: bool
    slanted: Sequence[tuple[float, float, float]] = ()

    @property
    def key(self) -> tuple[tuple[str, ...], tuple[str, ...], str]:
        """Body, moved parts and posture."""
        return self.body, self.moved, self.up

    @property
    def sideways(self) -> list[str]:
        """Those of the directions that are horizontal on the jig."""
        return [j for j in self.directions if axis_index(j) != axis_index(self.up)]

    @property
    def steepest(self) -> tuple[float, float, float] | None:
        """The slanted direction that is nearest to ``up``, if only slanted ones are open."""
        if self.directions or not self.slanted:
            return None
        return max(self.slanted, key=self._rise)

    @property
    def rise(self) -> float:
        """Sine of the angle above the horizontal at which the moved parts come: 1 from above."""
        if self.steepest is not None:
            return self._rise(self.steepest)
        return 1.0 if self.up in self.directions else 0.0 if self.sideways else -1.0

    @property
    def approach(self) -> str:
        """Where the moved parts come from: "above" if possible, else "the side", else "below".

        What comes at an angle comes from above if it is steeper than 45 degrees, and from the side
        down to the horizontal.
        """
        if self.rise >= STEEP:
            return "above"
        return "the side" if self.rise >= -LEVEL else "below"

    def _rise(self, way: tuple[float, float, float]) -> float:
        return float(np.dot(way, unit_vector(self.up)))


@dataclass(frozen=True)
class Candidate:
    """One way to hold the product during a step, evaluated.

    Attributes:
        name: Names of the items on the jig, as words.
        body: Names of their parts.
        moved: Names of the parts that are brought to them.
        up: Axis of the product frame that points up on the jig.
        approach: Where the moved parts come from, seen on the jig: "above", "the side" or "below".
        figures: What was computed before it was rejected, if it was; SI units in the names.
        scores: Per criterion from 0 to 1; empty if rejected.
        rejected: Why it cannot be used; "" if it can.
        notes: What else has to be provided for it.
    """

    name: str
    body: tuple[str, ...]
    moved: tuple[str, ...]
    up: str
    approach: str
    figures: Mapping[str, float]
    scores: Mapping[str, float]
    rejected: str
    notes: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Body and posture as words."""
        return f"{self.name} with {self.up} up"

    @property
    def score(self) -> float:
        """Mean of the scores; 0 if rejected."""
        return sum(self.scores.values()) / len(self.scores) if self.scores else 0.0


@dataclass(frozen=True, eq=False)
class Judged:
    """What the holding map said of a candidate.

    Attributes:
        held: The body on its fixture.
        cases: The loads of the step, with what is borne of each.
    """

    held: HeldBody
    cases: tuple[LoadCase, ...]


@dataclass(frozen=True)
class Choice:
    """The general rule's ranking of the candidates of one step.

    Attributes:
        item: The item of the order that is added.
        candidates: Best first, the rejected ones last.
        paper: Index of Algorithm 1's choice among them.
        verdict: Whether both rules agree, in a sentence.
        judged: What the holding map said of Algorithm 1's choice; None: it was not asked.
    """

    item: str
    candidates: tuple[Candidate, ...]
    paper: int
    verdict: str
    judged: Judged | None = None

    @property
    def best(self) -> Candidate | None:
        """The best candidate, or None if all are rejected."""
        return None if self.candidates[0].rejected else self.candidates[0]

    @property
    def agrees(self) -> bool:
        """Whether Algorithm 1 chose the best one."""
        return self.paper == 0 and self.best is not None
