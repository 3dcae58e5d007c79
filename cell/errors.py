"""The errors this project raises on purpose: one line names the culprit and the alternatives.

Three kinds, told apart by what a caller does about them: `InputError`, something that was given
cannot be used and nothing was run (the command line's exit code 2); `RunFailure`, it ran and
failed (exit code 1); `MachineError`, the machine did not let it run (exit code 3).
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable


class CellError(Exception):
    """Base of every error this project raises on purpose."""


class InputError(CellError):
    """Something that was given cannot be used: a name, a file, a number, a combination."""


class RunFailure(CellError):
    """What was asked for was tried and failed: a verdict, with its evidence."""


class MachineError(CellError):
    """What the machine refused: a full disk, a folder that is read-only, no memory left."""


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


SHORT = 200  # Characters of a line that a person reads at a glance [A].
WORD = 60  # Characters without a space of which only the ends are shown in a long line [A].


def one_short_line(text: str) -> str:
    """Return a message as one line of at most `SHORT` characters, safe on any terminal.

    Of a longer one, long words lose their middle, and what is left loses its end. Line breaks,
    control characters and what cannot be encoded are written as escapes.
    """
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    if len(shown) > SHORT:
        shown = re.sub(rf"\S{{{WORD},}}", lambda word: f"{word[0][:32]}...{word[0][-16:]}", shown)
    return shown if len(shown) <= SHORT else f"{shown[: SHORT - 3].rstrip()}..."
