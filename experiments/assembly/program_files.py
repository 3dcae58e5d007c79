"""Robot programs in a folder: ``program.json``, ``config.yaml``, and a script per arm of UR's."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from cell.errors import InputError
from cell.machines.arms.ur import UrArm
from cell.simulation.identity import identity_of
from experiments.assembly.job import Job
from experiments.assembly.run import Run
from experiments.assembly.urscript import urscript
from experiments.reporting.output import write_json, write_text
from planning.operations.program import Transcript

FORMAT = "soft-jig program 1"


def write_program(
    folder: Path, job: Job, order: Sequence[str], run: Run, transcript: Transcript
) -> str | None:
    """Write the program of a run; scripts for robots only if the run succeeded.

    Returns:
        Why there is none, if there is none.
    """
    if transcript.problem is not None:
        return transcript.problem
    cell = run.simulation.cell
    data: dict[str, Any] = {
        "format": FORMAT,
        "product": job.product.name,
        "identity": identity_of(cell)["product"],
        "order": list(order),
        "seed": job.seed,
        "verdict": run.verdict,
        "steps": transcript.steps,
        "commands": transcript.commands,
    }
    write_json(folder / "program.json", data)
    write_text(folder / "config.yaml", yaml.safe_dump(job.config.to_dict(), sort_keys=False))
    for arm in cell.arms.values():
        script = folder / f"{arm.name}.script"
        script.unlink(missing_ok=True)
        if run.verdict == "success" and isinstance(arm.model, UrArm):
            write_text(script, urscript(cell, arm, data))
    return None


def read_program(folder: Path) -> dict[str, Any]:
    """Read ``program.json`` of a folder.

    Raises:
        InputError: There is none, or it is something else.
    """
    path = folder / "program.json"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"There is no program in '{folder}': program.json is missing.") from None
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as a program.") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise InputError(f"'{path}' is not a program of the form '{FORMAT}'.")
    return data
