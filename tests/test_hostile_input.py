"""Whatever is given: one short line that names the culprit, no crash, no hours, no gigabytes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hostile_input import KINDS

TESTS = Path(__file__).resolve().parent


@pytest.mark.parametrize("kind", KINDS)
def test_every_input_ends_as_it_should(kind: str) -> None:
    """A process of its own forks one for every input: this one may have threads."""
    done = subprocess.run(
        [sys.executable, str(TESTS / "fuzz.py"), kind],
        env={**os.environ, "PYTHONPATH": str(TESTS.parent), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    result = json.loads(done.stdout)
    assert result["wrong"] == []
    assert result["inputs"] == sum(1 for _ in KINDS[kind]())


def test_the_set_is_large_and_always_the_same() -> None:
    first, second = ([case for cases in KINDS.values() for case in cases()] for _ in range(2))
    assert len(first) >= 500
    assert first == second
