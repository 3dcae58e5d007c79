"""One thing that was checked, and what came out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    """How bad it is."""

    GOOD = "ok"
    DOUBTFUL = "doubtful"
    FAILS = "fails"


@dataclass(frozen=True)
class Finding:
    """One line of a check.

    Attributes:
        level: How bad it is.
        subject: Name of a part, a step or a thing.
        text: What was found, with figures and what can be done.
    """

    level: Level
    subject: str
    text: str

    def __str__(self) -> str:
        return f"{self.level.value:9}{self.subject}: {self.text}"


def fails(subject: str, text: str) -> Finding:
    """Return a finding that the assembly will fail for."""
    return Finding(Level.FAILS, subject, text)


def doubtful(subject: str, text: str) -> Finding:
    """Return a finding that it may fail for."""
    return Finding(Level.DOUBTFUL, subject, text)


def good(subject: str, text: str) -> Finding:
    """Return a finding that nothing is wrong."""
    return Finding(Level.GOOD, subject, text)
