"""A guess about a product: what, why, and how sure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Guess:
    """One thing that CAD does not say.

    Attributes:
        subject: Name of a part, or of several with commas.
        what: The guess, for example "M4 socket cap screw, 12 mm long".
        reason: What in the CAD speaks for it.
        confidence: From 0 to 1: how often such a guess is right, roughly [A].
    """

    subject: str
    what: str
    reason: str
    confidence: float

    def __str__(self) -> str:
        return f"{self.subject}: {self.what} ({self.reason}; {100 * self.confidence:.0f} %)"
