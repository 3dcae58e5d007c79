"""Runs hostile and careless input through the command line, each in a process with limits.

    PYTHONPATH=. python tests/fuzz.py [KIND ...]

Prints a line of JSON per kind: how many inputs, how they ended, and what is wrong with which of
them. The inputs are those of ``hostile_input.py``, seeded.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hostile_input import KINDS, Case

import experiments.assembly.assemble
import experiments.paper.place_push
import experiments.plan.page  # noqa: F401  What the children need is imported once.
from experiments.cli.main import main as soft_jig

SECONDS = 60  # Of CPU.
MEMORY = 6 << 30  # [byte]
LONGEST_LINE = 200
TRACEBACK = 99  # Exit code of a child whose exception reached us.


def run(case: Case) -> tuple[int, str, str]:
    """Return exit code (negative: the signal), what stands on stderr, and what is wrong."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "empty" / "work"
        folder.mkdir(parents=True)
        for path, content in case.files.items():
            file = folder / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.mkdir() if content is None else file.write_bytes(content)
        before = set(folder.rglob("*"))
        with tempfile.TemporaryFile("w+b") as out, tempfile.TemporaryFile("w+b") as err:
            child = os.fork()
            if not child:
                _be_child(case, folder, out.fileno(), err.fileno())
            _, status, usage = os.wait4(child, 0)
            out.seek(0)
            err.seek(0)
            stdout, stderr = out.read(), err.read().decode(errors="replace")
        new = set(folder.rglob("*")) - before
    code = os.waitstatus_to_exitcode(status)
    return code, stderr, "; ".join(_wrong(case, code, stdout, stderr, len(new), usage))


def _be_child(case: Case, folder: Path, out: int, err: int) -> None:
    code = TRACEBACK
    try:
        os.chdir(folder)
        os.dup2(out, 1)
        os.dup2(err, 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        if case.closed:
            os.close(1)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.environ["XDG_CACHE_HOME"] = str(folder.parent.parent / "cache")
        for key, value in case.environment.items():
            os.environ.pop(key, None)
            if value is not None:
                os.environ[key] = value
        code = soft_jig(case.arguments)
        with contextlib.suppress(OSError):
            sys.stdout.flush()
        sys.stderr.flush()
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else 0
    finally:
        os._exit(code)


def _wrong(
    case: Case, code: int, stdout: bytes, stderr: str, new: int, usage: resource.struct_rusage
) -> Iterator[str]:
    lines = stderr.splitlines()
    seconds = usage.ru_utime + usage.ru_stime
    if code < 0:
        yield f"signal {-code}"
    if code == TRACEBACK or "Traceback" in stderr:
        yield "traceback"
    if seconds > SECONDS:
        yield f"{seconds:.0f} s"
    if code not in case.codes:
        yield f"exit code {code}"
    if len(lines) != (code == 2):
        yield f"{len(lines)} lines"
    if max(map(len, lines), default=0) > LONGEST_LINE:
        yield f"a line of {max(map(len, lines))} characters"
    if code == 2 and not any(culprit in stderr for culprit in case.culprits):
        yield "names no culprit"
    if code == 2 and new:
        yield f"{new} new files"
    if any(byte < 32 and byte not in b"\n\t\r" for byte in stdout + stderr.encode()):
        yield "control characters"


def outcome(kind: str) -> dict[str, Any]:
    """Run all inputs of a kind."""
    codes: Counter[int] = Counter()
    wrong, started = [], time.perf_counter()
    for case in KINDS[kind]():
        code, stderr, fault = run(case)
        codes[code] += 1
        if fault:
            wrong.append(f"{case.name}: {fault}: {stderr[-300:].strip()}")
    return {
        "kind": kind,
        "inputs": codes.total(),
        "codes": dict(sorted(codes.items())),
        "seconds": round(time.perf_counter() - started, 1),
        "wrong": wrong,
    }


if __name__ == "__main__":
    for _kind in sys.argv[1:] or KINDS:
        print(json.dumps(outcome(_kind), ensure_ascii=False), flush=True)
