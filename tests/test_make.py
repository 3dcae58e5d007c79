"""`make` finds a Python that suits by running it: a name on PATH proves nothing."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TOOLS = ("make", "sh", "dirname")  # All that the search needs besides a Python.

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the only folder on PATH: the tools are there, and no Python yet."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for tool in TOOLS:
        found = shutil.which(tool)
        assert found is not None
        (folder / tool).symlink_to(found)
    return folder


def program(path: Path, body: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return path


def python(path: Path, version: str) -> Path:
    """Write a stand-in that answers the one question of the search, its version."""
    return program(path, f"echo {version}")


def find(folder: Path, *options: str, path: str | None = None) -> subprocess.CompletedProcess[str]:
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("MAKE", "PY"))}
    environment = kept | {"PATH": path or str(folder), "HOME": str(folder.parent)}
    command = [str(folder / "make"), "-s", "find-python", *options]
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)


def test_newest_that_suits_is_chosen(folder: Path) -> None:
    python(folder / "python3.12", "3.12")
    python(folder / "python3", "3.11")
    newest = python(folder / "python3.13", "3.13")
    python(folder / "python3.14", "3.14")
    assert find(folder).stdout == f"{newest}\n"


def test_plain_python3_counts_by_its_version(folder: Path) -> None:
    python(folder / "python3.12", "3.12")
    newest = python(folder / "python3", "3.13")
    assert find(folder).stdout == f"{newest}\n"


def test_shim_that_fails_is_passed_over(folder: Path) -> None:
    """What lies behind it on PATH comes next."""
    shims = folder.parent / "shims"
    program(shims / "python3.13", "echo 'command not found' >&2; exit 127")
    behind = python(folder / "python3.13", "3.13")
    assert find(folder, path=f"{shims}:{folder}").stdout == f"{behind}\n"


def test_pyenv_has_what_path_lacks(folder: Path) -> None:
    program(folder / "python3.13", "exit 127")
    python(folder / "python3", "3.11")
    versions = folder.parent / ".pyenv" / "versions"
    python(versions / "3.12.1" / "bin" / "python", "3.12")
    newest = python(versions / "3.13.0" / "bin" / "python", "3.13")
    assert find(folder).stdout == f"{newest}\n"


def test_uv_fetches_what_is_nowhere(folder: Path) -> None:
    python(folder / "python3", "3.11")
    program(folder / "uv", '[ "$2" = find ] && echo /fetched/python3.13; exit 0')
    assert find(folder).stdout == "/fetched/python3.13\n"


def test_named_python_wins(folder: Path) -> None:
    python(folder / "python3.13", "3.13")
    named = python(folder.parent / "mine", "3.12")
    assert find(folder, f"PYTHON={named}").stdout == f"{named}\n"


@pytest.mark.parametrize(
    ("body", "reason"),
    [("echo 3.11", "is Python 3.11"), ("echo 3.14", "is Python 3.14"), ("exit 1", "does not run")],
)
def test_named_python_that_does_not_suit_is_refused_in_one_line(
    folder: Path, body: str, reason: str
) -> None:
    python(folder / "python3.13", "3.13")
    program(folder / "mine", body)
    result = find(folder, "PYTHON=mine")
    said, status = result.stderr.splitlines()  # The second line is make's own.
    assert said == f"PYTHON=mine {reason}; needed is Python 3.12 or 3.13."
    assert status.startswith("make: ***")
    assert result.returncode != 0 and not result.stdout


def test_nothing_found_is_said_in_one_line(folder: Path) -> None:
    program(folder / "uv", "echo 'no network' >&2; exit 2")
    said, _ = find(folder).stderr.splitlines()
    assert "make PYTHON=" in said
