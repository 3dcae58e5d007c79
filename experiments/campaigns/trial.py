"""A trial: what it is given, what comes out of it, and what identifies it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cell.configuration.config import CellConfig

DONE = ("success", "failure")
"""Verdicts that stand. Trials that ended with an error or were killed are run again."""

VERDICTS = (*DONE, "error", "killed")


@dataclass(frozen=True)
class Task:
    """What the function of an experiment is given, beside the experiment's own options.

    Attributes:
        product: A name in ``models/products``, or a file.
        config: Of the cell, with the values of this trial.
        seed: Of everything that is random.
        folder: For files that the trial leaves behind: use `file`.
    """

    product: str
    config: CellConfig
    seed: int
    folder: Path

    def file(self, name: str) -> Path:
        """Return the path of a file that the trial leaves behind, in a folder that exists."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder / name


@dataclass(frozen=True)
class Outcome:
    """What the function of an experiment returns.

    Attributes:
        success: Whether the trial succeeded.
        measured: Quantity -> value; SI units are in the names. What is not finite becomes empty.
        phase: In which it failed; "" if it succeeded.
        evidence: Why it failed, in one line.
    """

    success: bool
    measured: Mapping[str, float] = field(default_factory=dict)
    phase: str = ""
    evidence: str = ""


@dataclass(frozen=True)
class Trial:
    """A trial that is to be run.

    Attributes:
        experiment: Name of an experiment, or ``FILE.py:FUNCTION``.
        product: A name in ``models/products``, or a file.
        config: Of the cell.
        seed: Of everything that is random.
        options: Of the experiment's own, by name.
        varied: What differs between the trials of the campaign, the seed apart.
        code: Digest of the code that runs it.
        key: Digest of all of these but ``varied``, and of the product's content.
    """

    experiment: str
    product: str
    config: CellConfig
    seed: int
    options: Mapping[str, Any]
    varied: Mapping[str, Any]
    code: str
    key: str


@dataclass(frozen=True)
class Row:
    """A trial that has ended: the content of its file.

    Attributes:
        key: Of the trial; the name of its file.
        experiment: Its name.
        product: Its name or file.
        seed: Of everything that is random.
        varied: What differs between the trials of the campaign that ran it, the seed apart.
        options: Of the experiment's own, by name.
        settings: Values of the configuration that differ from the defaults, by path.
        verdict: "success" or "failure"; "error" if its code raised something unexpected; "killed"
            if its process ended before it did.
        phase: In which it failed.
        evidence: Why, in one line.
        measured: Quantity -> value, None where it was not finite.
        cpu_seconds: That its process spent.
        files: That it left behind, in the folder of the campaign.
        traceback: Of an error.
        code: Digest of the code that ran it.
        versions: Of Python and of packages.
    """

    key: str
    experiment: str
    product: str
    seed: int
    varied: Mapping[str, Any]
    options: Mapping[str, Any]
    settings: Mapping[str, Any]
    verdict: str
    phase: str = ""
    evidence: str = ""
    measured: Mapping[str, float | None] = field(default_factory=dict)
    cpu_seconds: float = 0.0
    files: tuple[str, ...] = ()
    traceback: str = ""
    code: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def done(self) -> bool:
        """Whether its verdict stands."""
        return self.verdict in DONE
