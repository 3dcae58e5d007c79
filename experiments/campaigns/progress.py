"""What a person sees of a campaign: a bar on a terminal, else one line per trial."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any

from rich import progress as bars
from rich.console import Console

from experiments.campaigns.trial import Row


class Progress:
    """Follows the trials that are still to be run.

    Args:
        console: Where to print; a quiet one prints nothing.
        waiting: Number of them.
    """

    def __init__(self, console: Console, waiting: int) -> None:
        self.console, self.waiting, self.ended = console, waiting, 0
        self.failed = 0
        self.started = time.monotonic()
        columns = (
            bars.BarColumn(),
            bars.MofNCompleteColumn(),
            bars.TextColumn("{task.description}"),
            bars.TimeElapsedColumn(),
        )
        self.hidden = console.quiet or not console.is_terminal
        self.bar = bars.Progress(*columns, console=console, transient=True, disable=self.hidden)
        self.task = self.bar.add_task("", total=waiting)

    def __enter__(self) -> Progress:
        self.bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.bar.stop()

    def trial(self, row: Row) -> None:
        """Show that a trial has ended."""
        self.ended += 1
        self.failed += row.verdict != "success"
        spent = time.monotonic() - self.started
        left = duration(spent / self.ended * (self.waiting - self.ended))
        self.bar.update(self.task, advance=1, description=f"{self.failed} failed, {left} left")
        if self.hidden:
            why = f" in '{row.phase}'" if row.phase else ""
            text = f"{self.ended}/{self.waiting} {row.verdict}{why}: {label(row.varied, row.seed)}"
            self.console.print(
                f"{text}, {row.cpu_seconds:.1f} s of CPU, {left} left",
                markup=False,
                soft_wrap=True,
            )


def label(varied: Mapping[str, Any], seed: int) -> str:
    """Return what tells a trial from the others, as text."""
    values = [f"{k}={v:.5g}" if isinstance(v, float) else f"{k}={v}" for k, v in varied.items()]
    return ", ".join([*values, f"seed {seed}"])


def duration(seconds: float) -> str:
    """Return a time for a person: "40 s", "12 min", "3.5 h"."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
