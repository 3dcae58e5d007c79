"""The folder of a campaign: one file per trial, written whole, checked when it is read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cell.errors import InputError
from experiments.campaigns.trial import Row
from experiments.reporting.output import whole_file, write_json

TRIALS = "trials"
INDEX = "trials.parquet"
CHECKSUM = "checksum"
COLUMNS = (
    "key", "experiment", "product", "seed", "verdict", "phase", "evidence", "cpu_seconds",
)  # fmt: skip


class DamagedTrial(InputError):
    """The file of a trial that is not what was written."""


def trial_folder(out: Path, key: str) -> Path:
    """Return the folder for what a trial leaves behind beside its file."""
    return out / TRIALS / key


def trial_file(out: Path, key: str) -> Path:
    """Return the file of a trial."""
    return out / TRIALS / f"{key}.json"


def write_trial(out: Path, row: Row) -> None:
    """Write the file of a trial, whole or not at all."""
    (out / TRIALS).mkdir(parents=True, exist_ok=True)
    body = asdict(row)
    write_json(trial_file(out, row.key), body | {CHECKSUM: _checksum(body)})


def read_trial(file: Path) -> Row:
    """Return a trial that has ended.

    Raises:
        DamagedTrial: The file has been cut off or changed.
        FileNotFoundError: There is none.
    """
    try:
        body = json.loads(file.read_text(encoding="utf-8"))
        stated = body.pop(CHECKSUM)
        row = Row(**body | {"files": tuple(body["files"])})
    except FileNotFoundError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DamagedTrial(f"'{file}' is damaged: {error}.") from error
    if stated != _checksum(body):
        raise DamagedTrial(f"'{file}' is damaged: its checksum differs.")
    if row.key != file.stem:
        raise DamagedTrial(f"'{file}' is that of another trial, {row.key}.")
    return row


def _checksum(body: dict[str, Any]) -> str:
    # As it comes out of a file again: tuples are lists, keys are text.
    text = json.dumps(body, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def columns_of(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """Return one list per column over all trials, None where a trial has no value.

    The first are `COLUMNS`; then what differs between the trials, then every measured quantity,
    each under its own name.

    Raises:
        InputError: Two columns would have one name.
    """
    found = {name: [getattr(row, name) for row in rows] for name in COLUMNS}
    for kind in ("varied", "measured"):
        for name in _names(getattr(row, kind) for row in rows):
            if name in found and (kind, name) != ("varied", "product"):
                raise InputError(f"'{name}' is the name of two columns: rename what is measured.")
            found[name] = [getattr(row, kind).get(name) for row in rows]
    return found


def _names(mappings: Iterable[Any]) -> list[str]:
    return list(dict.fromkeys(name for mapping in mappings for name in mapping))


def write_index(out: Path, rows: Sequence[Row]) -> None:
    """Write one row per trial as ``trials.parquet``."""
    import pyarrow as pa  # Workers can do without.
    import pyarrow.parquet as parquet

    measured = set(_names(row.measured for row in rows))
    columns = {
        name: pa.array(values, pa.float64() if name in measured else None)
        for name, values in columns_of(rows).items()
    }
    with whole_file(out / INDEX) as temporary:
        parquet.write_table(pa.table(columns), temporary)
