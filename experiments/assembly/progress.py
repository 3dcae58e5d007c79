"""What a person sees of a run: where it is, and a table at its end."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

from rich import progress as bars
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.assembly.run import StepResult


class Progress:
    """A bar with the present phase, if the output is a terminal; else one line per step."""

    def __init__(self, console: Console, steps: Sequence[str]) -> None:
        self.console, self.steps = console, list(steps)
        columns = (
            bars.SpinnerColumn(),
            bars.TextColumn("{task.description}"),
            bars.BarColumn(),
            bars.MofNCompleteColumn(),
            bars.TimeElapsedColumn(),
        )
        hidden = console.quiet or not console.is_terminal
        self.bar = bars.Progress(*columns, console=console, transient=True, disable=hidden)
        self.task = self.bar.add_task("starting", total=len(self.steps))

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

    def phase(self, name: str) -> None:
        """Show which phase runs."""
        self.bar.update(self.task, description=escape(f"{name:30s}"))
        if self.console.is_terminal:
            self.console.print(f"  {name}", markup=False)

    def step(self, step: StepResult) -> None:
        """Show that a step is done."""
        self.bar.advance(self.task)
        text = f"{step.name}: {step.verdict}, {step.sim_seconds:.1f} s simulated"
        self.console.print(f"{text} in {step.cpu_seconds:.1f} s", markup=False)


def result_table(steps: Sequence[StepResult]) -> Table:
    """Return one row per step, and below it each check that failed."""
    table = Table(title="Assembly", title_justify="left")
    for heading in ("step", "verdict", "simulated [s]", "CPU [s]", "outside of its limit"):
        table.add_column(escape(heading), justify="right" if "[s]" in heading else "left")
    for step in steps:
        failed = [
            f"{check.quantity}: "
            + ("not measured" if check.value is None else f"{check.value:.4g} > {check.limit:.4g}")
            for check in step.failed_checks
        ]
        seconds = f"{step.sim_seconds:.1f}", f"{step.cpu_seconds:.1f}"
        table.add_row(escape(step.name), step.verdict, *seconds, escape("\n".join(failed)))
    return table
