"""Every tutorial in the documentation runs to its end from an empty folder."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.py"))
TIME_LIMIT = 240.0  # [s]; on a free core the longest takes 15 s.


@pytest.mark.parametrize("script", TUTORIALS, ids=lambda script: script.stem)
def test_tutorial_runs_and_says_what_it_found(script: Path, tmp_path: Path) -> None:
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


@pytest.mark.parametrize("script", TUTORIALS, ids=lambda script: script.stem)
def test_tutorial_uses_only_what_is_public(script: Path) -> None:
    """What is imported of the project is imported from the top of a package."""
    text = script.read_text()
    for package in ("cell", "planning", "experiments"):
        assert f"from {package}." not in text
        assert f"import {package}" not in text.replace(f"from {package} import", "")


def test_there_are_tutorials() -> None:
    assert len(TUTORIALS) >= 6


def test_the_first_tutorial_is_short() -> None:
    """Your own diagram takes less than 60 lines of code, imports included."""
    script = ROOT / "docs" / "tutorials" / "own_diagram.py"
    _, _, code = script.read_text().split('"""', 2)
    lines = [
        line for line in code.splitlines() if line.strip() and not line.strip().startswith("#")
    ]
    assert len(lines) < 60
