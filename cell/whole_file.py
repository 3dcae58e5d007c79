"""Files that appear whole or not at all: the one way in which this project writes a result."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cell.errors import CellError, InputError, MachineError

PARTIAL = ".part"  # Ending of a file that is still being written.
# A path that cannot be a file, whatever the state of the machine.
BAD_PATH = {
    errno.EEXIST, errno.EINVAL, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOENT,
    errno.ENOTDIR, errno.ENOTEMPTY,
}  # fmt: skip


def cannot_write(path: Path, error: OSError) -> CellError:
    """Return the error of a path that cannot be written: bad input, or a fault of the machine."""
    kind = InputError if error.errno in BAD_PATH else MachineError
    return kind(f"Cannot write '{path}': {error.strerror or error}.")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Provide a temporary file beside ``path``, which replaces ``path`` at the end.

    If the work raises, or the process dies, ``path`` is unchanged. The temporary name is random:
    process numbers repeat, on other machines and in containers. The content is on the disk before
    ``path`` is replaced, so that a loss of power leaves the old file or the new one.

    Raises:
        MachineError: The disk is full, or cannot be written to.
        InputError: ``path`` cannot be a file.
    """
    temporary = path.with_name(f".{secrets.token_hex(8)}{PARTIAL}")
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def remove_partial(folder: Path) -> None:
    """Remove what killed writers have left in a folder; nobody may be writing there."""
    for path in folder.glob(f".{'[0-9a-f]' * 16}{PARTIAL}"):
        path.unlink(missing_ok=True)
