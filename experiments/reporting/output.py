"""Output folder and files of a command: checked before the work, written whole or not at all."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cell.errors import InputError
from cell.whole_file import cannot_write, remove_partial, whole_file
from experiments.reporting.folder_lock import locked


@contextmanager
def output_folder(path: Path, *names: str) -> Iterator[Path]:
    """Make a folder and hold it for one run: check it, and lock it, before any work.

    Folders that were made here are removed again if the work raises and leaves them empty.

    Args:
        path: Of the folder.
        names: Of the files that will be written: none of them may be a folder.

    Raises:
        InputError: It cannot be a folder, or another run writes to it.
        MachineError: It cannot be written to.
    """
    with writable_folder(path), locked(path):
        remove_partial(path)
        for name in names:
            if (path / name).is_dir():
                raise InputError(f"Cannot write '{path / name}': it is a folder.")
        yield path


@contextmanager
def writable_folder(path: Path) -> Iterator[Path]:
    """Make a folder and check that it can be written to; others may write there as well.

    Raises:
        InputError: It cannot be a folder.
        MachineError: It cannot be written to.
    """
    made: list[Path] = []
    try:
        made = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True, exist_ok=True)
        # Permission bits do not tell (root, read-only mounts, full disks): try.
        with tempfile.TemporaryFile(dir=path) as probe:
            probe.write(bytes(4096))
    except OSError as error:
        _remove_empty(made)
        raise cannot_write(path, error) from error
    except ValueError as error:  # A NUL in the path.
        raise InputError(f"Cannot write to folder {str(path)!r}: {error}.") from error
    try:
        yield path
    except BaseException:
        _remove_empty(made)
        raise


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders, innermost first, up to the first one that is not empty."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON; numpy numbers and arrays become plain ones.

    Raises:
        ValueError: For NaN and infinity, which JSON does not have.
    """
    text = json.dumps(value, indent=2, default=_plain, allow_nan=False)
    write_text(path, text + "\n")


def write_arrays(path: Path, arrays: dict[str, np.ndarray], *, compressed: bool = True) -> None:
    """Write arrays as an npz; uncompressed, it takes a tenth of the time."""
    save = np.savez_compressed if compressed else np.savez
    with whole_file(path) as temporary, temporary.open("wb") as file:
        save(file, **arrays)  # type: ignore[arg-type]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"No JSON for {type(value).__name__}.")
