"""The values of the general rule: what it is told, and what it says of a candidate and a step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cell.configuration.config import CellConfig
from cell.fixtures.soft_jig import JigParameters

CRITERIA: Mapping[str, str] = {
    "reach": "1 if the moved part comes from above, 1/2 from the side",
    "stability": "angle by which the centre of gravity could lean, of 90 degrees; the lower of the "
    "body alone and with the moved part on it",
    "footprint": "share of the bag's diameter that is left beside the footprint",
    "imprint": "share of the bag's depth that is left below the body",
    "holding": "m / (1 + m), m: force it bears across, per force that the operation exerts across",
    "gripper": "share of the gripper's stroke that is left over the widest of what must be "
    "gripped; 0 also for jaws made wider than it",
    "continuity": "1 if the jig holds the body in this posture already, or holds nothing yet",
}
"""What the scores of a candidate mean, each from 0 to 1."""


@dataclass(frozen=True)
class Setup:
    """What the general rule has to know of the cell.

    Attributes:
        jig: Bag, beads, vacuum, frozen bed.
        press_force: That a body is pressed on the jig with [N].
        insertion_force: Largest force along an insertion [N].
        driver_force: Thrust of the screwdriver [N].
    """

    jig: JigParameters
    press_force: float
    insertion_force: float
    driver_force: float

    @staticmethod
    def of(config: CellConfig) -> Setup:
        """Return what a configuration says."""
        return Setup(
            config.jig,
            config.placement.press_force,
            config.insertion.force_limit,
            config.driver.push_force,
        )


@dataclass(frozen=True)
class Candidate:
    """One way to hold the product for a step.

    Attributes:
        name: Items that the jig holds, as words.
        body: Names of their parts.
        moved: Names of the parts that are brought to them.
        up: Axis of the product frame that points up on the jig.
        approach: Where the moved parts come from, seen on the jig: "above", "the side" or "below".
        figures: What was found, SI units in the names; as far as it was looked at.
        scores: Per criterion from 0 to 1; empty if rejected.
        rejected: Why it cannot be used; "" if it can.
        notes: What has to be provided for.
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


@dataclass(frozen=True)
class Choice:
    """What the general rule says of one step.

    Attributes:
        item: The item of the order that comes in.
        candidates: Best first, the rejected ones last.
        paper: Place of Algorithm 1's choice among them.
        verdict: Whether both rules agree, in a sentence.
    """

    item: str
    candidates: tuple[Candidate, ...]
    paper: int
    verdict: str

    @property
    def best(self) -> Candidate | None:
        """The best candidate, or None if all are rejected."""
        return None if self.candidates[0].rejected else self.candidates[0]

    @property
    def agrees(self) -> bool:
        """Whether Algorithm 1 chose the best one."""
        return self.paper == 0 and self.best is not None
