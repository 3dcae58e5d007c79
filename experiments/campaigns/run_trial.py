"""What a worker does: one trial, to its file."""

from __future__ import annotations

import math
import shutil
import time
import traceback
from pathlib import Path

from cell.errors import CellError, MachineError, RunFailure
from experiments.campaigns.catalogue import experiment_named
from experiments.campaigns.code_version import code_digest
from experiments.campaigns.points import settings_of
from experiments.campaigns.store import trial_folder, write_trial
from experiments.campaigns.trial import Outcome, Row, Task, Trial
from experiments.reporting.provenance import versions

UNKNOWN_PHASE = "unknown"
EVIDENCE_LENGTH = 400


def run_trial(trial: Trial, out: Path) -> Row:
    """Run a trial, write its file and return its row.

    A failure is a verdict, and so is an exception of the experiment. What the machine refused is
    raised: a disk that is full says nothing about the trial, and the next one would fare no better.

    Raises:
        MachineError: A file of the trial cannot be written.
    """
    folder = trial_folder(out, trial.key)
    shutil.rmtree(folder, ignore_errors=True)  # Of an attempt that was killed.
    task = Task(trial.product, trial.config, trial.seed, folder)
    started, text = time.process_time(), ""
    try:
        experiment = experiment_named(trial.experiment)
        if code_digest(experiment.script) != trial.code:
            raise CellError(
                "The code or its packages are not those with which the campaign was begun."
            )
        outcome = experiment.function(task, **trial.options)
        verdict = "success" if outcome.success else "failure"
    except RunFailure as error:
        outcome, verdict = Outcome(False, phase=UNKNOWN_PHASE, evidence=str(error)), "failure"
    except MachineError:
        raise
    except Exception as error:
        text = traceback.format_exc()
        evidence = f"{type(error).__name__}: {error}"
        outcome, verdict = Outcome(False, evidence=evidence), "error"
    row = row_of(trial, verdict, outcome, time.process_time() - started, text, out)
    write_trial(out, row)
    return row


def row_of(
    trial: Trial, verdict: str, outcome: Outcome, cpu_seconds: float, text: str, out: Path
) -> Row:
    """Return the row of a trial that has ended.

    Args:
        trial: The trial.
        verdict: One of `VERDICTS`.
        outcome: What the experiment returned, or says for it why it did not.
        cpu_seconds: That its process spent.
        text: The traceback of an error.
        out: Folder of the campaign.
    """
    measured = {
        name: float(value) if math.isfinite(value) else None
        for name, value in outcome.measured.items()
    }
    files = sorted(trial_folder(out, trial.key).rglob("*"))
    return Row(
        key=trial.key,
        experiment=Path(trial.experiment).name,
        product=trial.product,
        seed=trial.seed,
        varied=dict(trial.varied),
        options=dict(trial.options),
        settings=dict(settings_of(trial.config)),
        verdict=verdict,
        phase=outcome.phase,
        evidence=" ".join(outcome.evidence.split())[:EVIDENCE_LENGTH],
        measured=measured,
        cpu_seconds=cpu_seconds,
        files=tuple(file.relative_to(out).as_posix() for file in files if file.is_file()),
        traceback=text,
        code=trial.code,
        versions=versions(),
    )
