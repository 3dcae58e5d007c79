"""The errors this project raises on purpose: one line names the culprit and the alternatives.

Two kinds, told apart by what a caller does about them: `InputError`, something that was given
cannot be used and nothing was run (the command line's exit code 2); `RunFailure`, it ran and
failed (exit code 1).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class CellError(Exception):
    """Base of every error this project raises on purpose."""


class InputError(CellError):
    """Something that was given cannot be used: a name, a file, a number, a combination."""


class RunFailure(CellError):
    """What was asked for was tried and failed: a verdict, with its evidence."""


class UnknownName(InputError):
    """A name that does not exist, with the names that do and the nearest one.

    Args:
        kind: What was looked up, for example "part" or "configuration key".
        name: The name that was not found.
        known: The names that exist.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        names = sorted(known)
        near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
        hint = f" Did you mean '{near[0]}'?" if near else ""
        super().__init__(f"No {kind} '{name}'.{hint} Known: {', '.join(names)}.")


class BadPart(InputError):
    """A part whose description cannot be used, with the reason."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"Part '{name}': {reason}.")


class BadOrder(InputError):
    """An assembly order that does not list every part once."""
