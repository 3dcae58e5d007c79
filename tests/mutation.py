"""Mutation testing: does a test fail when an important line is wrong? Prints a table in Markdown.

    python tests/mutation.py [--trust] [NUMBER ...]

Each mutant of ``mutants.yaml`` changes one line in a copy of the tracked files, in which the fast
tests that are named with it are run: it is caught if one of them fails, and survives if none does.
The tests are run without a mutant first, unless they are to be trusted. Takes some ten minutes of
one core, at the lowest priority. Exit code 0: at least `GOAL` are caught.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
GOAL = 0.9
LIBRARIES = (
    "hypothesis", "manifold3d", "matplotlib.figure", "ompl.base", "pydrake.all",
    "rich.console", "scipy.optimize", "scipy.stats", "trimesh", "tyro", "yaml",
)  # fmt: skip
CPU_LIMIT = 180  # [s] Of the tests of one mutant: one that loops for ever is caught by it.


@dataclass(frozen=True)
class Mutant:
    """One wrong line.

    Attributes:
        wrong: What the code does wrongly then.
        file: In which.
        old: Text that occurs once in it.
        new: What stands there instead.
        tests: Test files, without ``test_`` and ending, or tests of them, ``FILE::TEST``.
    """

    wrong: str
    file: str
    old: str
    new: str
    tests: list[str]


def mutants() -> list[Mutant]:
    """Return the mutants of the table."""
    rows = yaml.safe_load((ROOT / "tests" / "mutants.yaml").read_text())
    return [Mutant(**row) for row in rows]


def copied(folder: Path) -> Path:
    """Copy the tracked files, as they are now, into a folder; return it."""
    names = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def tested(folder: Path, tests: Iterable[str]) -> tuple[int, str]:
    """Run test files in a copy, up to the first failure; return pytest's exit code and output.

    In a child of this process, which has imported the libraries already, but nothing of ours.
    """
    parts = [name.partition("::") for name in tests]
    chosen = [f"tests/test_{file}.py{sep}{test}" for file, sep, test in parts]
    log = folder / "mutation.log"
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT, CPU_LIMIT))
        os.chdir(folder)
        os.environ["PYTHONPATH"] = sys.path[0] = str(folder)
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(output, 1)
        os.dup2(output, 2)
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
        code = int(pytest.main([*options, *chosen]))
        sys.stdout.flush()
        os._exit(code)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), log.read_text(errors="replace")


def outcome(folder: Path, mutant: Mutant, number: int) -> str:
    """Return which test catches a mutant, or "survives"."""
    file = folder / mutant.file
    text, times = file.read_text(), file.stat()
    if text.count(mutant.old) != 1:
        raise SystemExit(f"{mutant.file}: {text.count(mutant.old)} times '{mutant.old}'.")
    file.write_text(text.replace(mutant.old, mutant.new))
    # Python knows its compiled files by the time and size of the source.
    os.utime(file, (times.st_atime, times.st_mtime + number))
    try:
        code, output = tested(folder, mutant.tests)
    finally:
        file.write_text(text)
        os.utime(file, (times.st_atime, times.st_mtime))
    if code == 0:
        return "survives"
    failed = [line for line in output.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    if failed:
        return failed[0].split(" - ")[0].removeprefix("FAILED ").removeprefix("ERROR ")
    return "ran too long" if code < 0 else f"exit code {code}"


def main() -> int:
    """Print the table; return 0 if the goal is met."""
    os.nice(19)
    os.environ["OPENBLAS_NUM_THREADS"] = (
        "1"  # A process with threads is not to be forked: no pyarrow, either.
    )
    for name in LIBRARIES:
        with suppress(ImportError):
            import_module(name)
    table = mutants()
    words = [word for word in sys.argv[1:] if word != "--trust"]
    numbers = [int(word) for word in words] or range(1, len(table) + 1)
    chosen = {number: table[number - 1] for number in numbers}
    with tempfile.TemporaryDirectory() as temporary:
        folder = copied(Path(temporary))
        files = dict.fromkeys(name for mutant in chosen.values() for name in mutant.tests)
        code, output = (0, "") if "--trust" in sys.argv else tested(folder, files)
        if code != 0:
            print(output[-3000:], file=sys.stderr)
            raise SystemExit("The tests fail without any mutant.")
        print("| | what is wrong | file | caught by |\n|--:|---|---|---|", flush=True)
        survivors = 0
        for number, mutant in chosen.items():
            found = outcome(folder, mutant, number)
            survivors += found == "survives"
            cells = (number, mutant.wrong, mutant.file, found.removeprefix("tests/"))
            print("|", " | ".join(map(str, cells)), "|", flush=True)
    caught = len(chosen) - survivors
    print(
        f"\n{caught} of {len(chosen)} caught: {caught / len(chosen):.0%}; {GOAL:.0%} are asked for."
    )
    return 0 if caught >= GOAL * len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
