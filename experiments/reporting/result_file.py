"""``result.json`` from the start of a run to its end, whatever ends it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from cell.errors import MachineError, RunFailure
from experiments.reporting.output import write_json

RESULT = "result.json"


class ResultFile:
    """The result of a run: its verdict is "running" until it has another one.

    As a context manager it is written at the start, over that of an earlier run. If the work
    raises, the verdict becomes "interrupted" or "error" and ``ended_by`` says why; after a kill it
    stays "running". It always holds what was done by then.

    Args:
        folder: Of the run.
        head: What is known from the start.

    Attributes:
        content: As it was last written.
    """

    def __init__(self, folder: Path, head: Mapping[str, Any]) -> None:
        self.path = folder / RESULT
        self.content: dict[str, Any] = {**head, "verdict": "running"}

    def __enter__(self) -> ResultFile:
        self.update()
        return self

    def update(self, **sections: Any) -> None:
        """Replace or add some of its content, and write it."""
        self.content |= sections
        write_json(self.path, self.content)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is None:
            return
        verdict = "error"
        if isinstance(error, KeyboardInterrupt):
            verdict = "interrupted"
        elif isinstance(error, RunFailure):
            verdict = "failure"
        ended_by = f"{type(error).__name__}: {error}"
        with suppress(MachineError):  # The disk is full: what is there is what was done.
            self.update(verdict=verdict, ended_by=ended_by)
