"""How a program of ours ends: with an exit code and, unless it succeeded, with one line.

0: done, and the verdict is success. 1: it ran, and the verdict is failure. 2: bad input, named in
the line. 3: an error of ours or of the machine. 130, 143: interrupted by SIGINT or SIGTERM.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from typing import Any, TextIO, cast

from cell.errors import CellError, InputError, MachineError, one_short_line
from experiments.cli.interrupt import Interrupted, interruptible

SUCCESS, FAILURE, BAD_INPUT, ERROR = range(4)


def exit_code(name: str, run: Callable[[], int]) -> int:
    """Return what the work of a program returns; what it raises becomes one line and a code.

    Args:
        name: Of the program, before the line.
        run: Its work, which a signal may interrupt.
    """
    with contextlib.redirect_stdout(cast(TextIO, Unbroken(sys.stdout))):
        try:
            with interruptible():
                return run()
        except CellError as error:
            code, line = _code_of(error), str(error)
        except Interrupted as error:
            code, line = error.exit_code, f"Interrupted by {error}: what was done is kept."
        except MemoryError:
            code, line = ERROR, "The memory does not suffice."
        except Exception as error:
            code, line = ERROR, _unexpected(error)
        if sys.stderr is not None:
            print(one_short_line(f"{name}: {line}"), file=Unbroken(sys.stderr))
        return code


def _code_of(error: CellError) -> int:
    if isinstance(error, InputError):
        return BAD_INPUT
    return ERROR if isinstance(error, MachineError) else FAILURE


def _unexpected(error: Exception) -> str:
    """Return the line of an error that is not one of ours; its traceback is kept in a file."""
    text = f"{type(error).__name__}: {error}"
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="soft-jig-", suffix=".txt", delete=False, encoding="utf-8"
        ) as file:
            traceback.print_exception(error, file=file)
    except OSError:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"Unexpected error at {os.path.basename(where.filename)}:{where.lineno}: {text}"
    return f"Unexpected error, see {file.name}: {text}"


class Unbroken:
    """A stream to which nobody may be listening any more: what is written then is dropped.

    Args:
        stream: The stream; None if it was closed before the program began.
    """

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = io.StringIO() if stream is None else stream

    def write(self, text: str) -> int:
        """Write, or drop the text."""
        try:
            return self._stream.write(text)
        except OSError:
            self._give_up()
        return len(text)

    def flush(self) -> None:
        """Flush, or drop what is left."""
        try:
            self._stream.flush()
        except OSError:
            self._give_up()

    def _give_up(self) -> None:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, self._stream.fileno())
        os.close(null)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
