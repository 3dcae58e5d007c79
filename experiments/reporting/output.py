"""Output folder and files of a command: checked before the work, written whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cell.errors import InputError


@contextmanager
def output_folder(path: Path) -> Iterator[Path]:
    """Make the folder and check that it is writable, before any work.

    Folders that were made here are removed again if the work raises and leaves them empty.

    Raises:
        InputError: The folder cannot be written to.
    """
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        # Permission bits do not tell (root, read-only mounts): try.
        tempfile.TemporaryFile(dir=path).close()
    except OSError as error:
        _remove_empty(made)
        raise InputError(f"Cannot write to folder '{path}': {error.strerror}.") from error
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


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Provide a temporary file beside ``path``, which replaces ``path`` at the end.

    If the work raises, ``path`` is unchanged.
    """
    temporary = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


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


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays as a compressed npz."""
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"No JSON for {type(value).__name__}.")
