"""Processes under faults of their machine: signals, kills, full disks, folders of others."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SHORT_RUN = str(ROOT / "tests" / "short_run.py")


class Process:
    """A program of ours in a process of its own.

    Args:
        program: Arguments of Python.
        largest_file: Size that no file may exceed, as on a full disk [byte]; None: no limit.
        environment: Added to that of this process.
    """

    def __init__(
        self, program: Sequence[str], *, largest_file: int | None = None, **environment: str
    ) -> None:
        def limit() -> None:
            if largest_file is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

        self.process = subprocess.Popen(
            [sys.executable, *program],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", **environment},
            preexec_fn=limit,
        )
        self.seconds_to_end = 0.0

    def wait_for(self, condition, longest: float = 60.0) -> None:
        """Wait until a condition holds while the process runs."""
        end = time.monotonic() + longest
        while not condition():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end
            time.sleep(0.01)

    def end(self, number: int | None = None) -> tuple[int, str]:
        """Send a signal, if one is given; return exit code and what stands on stderr."""
        started = time.monotonic()
        if number is not None:
            self.process.send_signal(number)
        _, stderr = self.process.communicate(timeout=120.0)
        self.seconds_to_end = time.monotonic() - started
        return self.process.returncode, stderr

    def kill(self) -> None:
        """End it as the kernel would when memory runs out."""
        self.end(signal.SIGKILL)


def result_in(folder: Path) -> dict[str, Any]:
    """Return ``result.json``; an empty dictionary if there is none."""
    path = folder / "result.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
