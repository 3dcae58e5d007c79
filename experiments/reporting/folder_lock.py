"""A lock on a folder: two runs that write the same files must not meet."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cell.errors import InputError
from cell.whole_file import cannot_write

LOCK = ".lock"
# Some network file systems have none: there, a second run is not noticed.
NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder.

    The kernel holds it for this process and gives it back when that ends, killed or not: the file
    that it is on says nothing, and one that was left behind does not matter.

    Raises:
        InputError: Another run holds it.
        MachineError: The file that it is on cannot be made.
    """
    path = folder / LOCK
    while True:
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise cannot_write(path, error) from error
        try:
            _lock(file, folder)
            if _is_at(file, path):
                break
        except BaseException:
            os.close(file)
            raise
        os.close(file)  # Whoever held it has removed the file in the meantime.
    try:
        with suppress(OSError):  # A full disk is found out by what follows.
            os.truncate(file, 0)
            os.write(file, f"process {os.getpid()} on {socket.gethostname()}".encode())
        yield
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(file)


def _lock(file: int, folder: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(file, 100, 0).decode(errors="replace") or "another process"
        raise InputError(
            f"Another run writes to folder '{folder}' ({holder}): "
            "wait for its end, or name another folder with --out."
        ) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise


def _is_at(file: int, path: Path) -> bool:
    """Return whether an open file is the one that a path leads to."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(path))
    except FileNotFoundError:
        return False
