"""What a person sees of a run."""

import io

from rich.console import Console

from experiments.assembly.progress import Progress, result_table
from experiments.assembly.run import StepResult
from planning.operations.limits import FailedCheck

GOOD = StepResult("place motor", "pick_place", "success", 11.9, 30.0, {}, ())
CHECKS = (
    FailedCheck("gap_m", 5e-4, 2e-4, "a reason"),
    FailedCheck("tilt_rad", None, 0.017, "a reason"),
)
BAD = StepResult("insert plate", "insert_shaft", "failure", 9.3, 30.0, {}, CHECKS)


def follow(console: Console) -> None:
    with Progress(console, ["place motor"]) as progress:
        progress.phase("motor: press")
        progress.step(GOOD)
    console.print(result_table([GOOD, BAD]))


def printed(**options) -> str:
    file = io.StringIO()
    follow(Console(file=file, width=120, highlight=False, **options))
    return file.getvalue()


def test_terminal_shows_every_phase() -> None:
    text = printed(force_terminal=True)
    assert "motor: press" in text
    assert "place motor: success, 11.9 s simulated" in text


def test_file_gets_one_line_per_step_and_the_table() -> None:
    text = printed()
    assert "motor: press" not in text
    assert "\x1b" not in text
    assert "gap_m: 0.0005 > 0.0002" in text
    assert "tilt_rad: not measured" in text


def test_quiet_prints_nothing() -> None:
    assert printed(quiet=True) == ""
