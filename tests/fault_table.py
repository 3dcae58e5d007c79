"""What each command does under each fault of its machine: prints a table in Markdown.

    PYTHONPATH=. python tests/fault_table.py [COMMAND ...]

Real processes; some minutes. A fault comes two seconds after a command has begun to work. The
tests in ``test_faults.py`` hold what the table shows.
"""

from __future__ import annotations

import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from faults import Process, result_in

COMMANDS = {
    "plan": ["-m", "experiments", "plan", "motor_unit", "--no-cache"],
    "assemble": ["-m", "experiments", "assemble"],
    "pick_place": ["-m", "experiments.pick_place"],
    "place": ["-m", "experiments", "place", "--case", "motor/P2", "--trials", "3"],
    "push": ["-m", "experiments", "push", "--case", "motor/P1/a", "--trials", "3"],
    "regress": ["-m", "experiments", "regress"],
}
FORMER = '{"verdict": "success", "of": "an earlier run"}'
WORKS = 2.0  # [s] After the folder has been locked, or the result says that it runs.


def started(command: str, out: Path, largest_file: int | None = None) -> Process:
    """Return a command in a process, in a folder with a result of an earlier run."""
    if not out.exists():
        out.mkdir()
        (out / "result.json").write_text(FORMER)
    return Process([*COMMANDS[command], "--quiet", "--out", str(out)], largest_file=largest_file)


def working(command: str, out: Path) -> Process:
    """Return a command that has been at work for a while."""
    process = started(command, out)
    process.wait_for((out / ".lock").exists)
    if command != "plan":
        process.wait_for(lambda: result_in(out).get("verdict") == "running")
    time.sleep(WORKS)
    return process


def after_signal(number: int) -> Callable[[str, Path], tuple[int, str, float]]:
    """Return the fault of a signal."""

    def fault(command: str, out: Path) -> tuple[int, str, float]:
        process = working(command, out)
        code, line = process.end(number)
        return code, line, process.seconds_to_end

    return fault


def full_disk(command: str, out: Path) -> tuple[int, str, float]:
    """No file may be larger than 5 kB, as on a disk that is all but full."""
    process = started(command, out, largest_file=5000)
    code, line = process.end()
    return code, line, process.seconds_to_end


def read_only(command: str, out: Path) -> tuple[int, str, float]:
    """A folder that not even root can write to."""
    process = Process([*COMMANDS[command], "--quiet", "--out", "/sys/out"])
    code, line = process.end()
    return code, line, process.seconds_to_end


def second_writer(command: str, out: Path) -> tuple[int, str, float]:
    """Another run is at work in the folder."""
    first = working(command, out)
    process = started(command, out)
    code, line = process.end()
    first.kill()
    return code, line, process.seconds_to_end


FAULTS: dict[str, Callable[[str, Path], tuple[int, str, float]]] = {
    "SIGINT": after_signal(signal.SIGINT),
    "SIGTERM": after_signal(signal.SIGTERM),
    "SIGKILL": after_signal(signal.SIGKILL),
    "full disk": full_disk,
    "read-only": read_only,
    "second writer": second_writer,
}


def main() -> None:
    """Print the table."""
    print("| command | fault | exit code | seconds | lines | verdict in the folder | line |")
    print("|---|---|--:|--:|--:|---|---|", flush=True)
    for command in sys.argv[1:] or COMMANDS:
        for name, fault in FAULTS.items():
            with tempfile.TemporaryDirectory() as folder:
                out = Path(folder) / "out"
                code, stderr, seconds = fault(command, out)
                result = result_in(out)
                verdict = "the former one" if "of" in result else result.get("verdict", "none")
                line = stderr.strip().replace(folder, "TMP").replace("\n", " / ")[:110]
                cells = (command, name, code, f"{seconds:.1f}", stderr.count("\n"), verdict, line)
                print("|", " | ".join(map(str, cells)), "|", flush=True)


if __name__ == "__main__":
    main()
