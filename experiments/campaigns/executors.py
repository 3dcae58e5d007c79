"""Where trials run: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from cell.errors import InputError

TASKS_PER_PROCESS = 10
"""[A] Then a process is replaced, so that memory that a library leaks does not add up."""

DASK = "dask://"
CONNECT_SECONDS = 10

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""A process per core leaves no core for a library's threads. Dask's workers set the same."""


class WorkerDied(RuntimeError):
    """A process ended before the trial that it was running."""


@contextmanager
def pool_at(address: str, workers: int) -> Iterator[Executor]:
    """Provide what runs trials; if the work raises, what has not begun is cancelled.

    Args:
        address: "local", or ``dask://HOST:PORT`` of a Dask scheduler.
        workers: Processes of this machine at a time; a cluster has its own.

    Raises:
        InputError: The address is unknown, or nothing answers there.
    """
    with ExitStack() as stack:
        if address == "local":
            pool: Executor = LocalExecutor(workers)
        else:
            pool = stack.enter_context(_dask_client(address)).get_executor(pure=False)
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        pool.shutdown()


def _dask_client(address: str) -> Any:
    if not address.startswith(DASK):
        raise InputError(f"--executor {address}: it is local, or dask://HOST:PORT.")
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--executor dask:// needs the package distributed: install soft-jig-cell[cluster]."
        ) from None
    try:
        return Client(f"tcp://{address.removeprefix(DASK)}", timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise InputError(f"No Dask scheduler answers at {address}.") from error


class LocalExecutor(Executor):
    """Processes of this machine, each with one task at a time.

    Unlike with `concurrent.futures.ProcessPoolExecutor`, a process that is killed takes only the
    task with it that it was running: that one raises `WorkerDied`, and a new process goes on.

    Args:
        workers: Number of processes.
        tasks_per_process: After which a process is replaced.
    """

    def __init__(self, workers: int, tasks_per_process: int = TASKS_PER_PROCESS) -> None:
        self._threads = ThreadPoolExecutor(workers)
        self._own = threading.local()
        self._all: list[_Worker] = []
        self._tasks = tasks_per_process

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run a function of a module in a process; `WorkerDied` if that is killed."""
        return self._threads.submit(self._call, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, at once if not asked to wait for what is still to do."""
        if not wait:
            self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in [] if wait else self._all:
            worker.end()
        self._threads.shutdown(wait=True, cancel_futures=cancel_futures)
        for worker in self._all:
            worker.end()

    def _call(self, fn: Callable[..., Any], args: Any, kwargs: Any) -> Any:
        if not hasattr(self._own, "worker"):
            self._own.worker = _Worker(self._tasks)
            self._all.append(self._own.worker)
        return self._own.worker.call(fn, args, kwargs)


class _Worker:
    """A process that carries out tasks one after another, and its successors."""

    def __init__(self, tasks: int) -> None:
        self._tasks, self._left = tasks, 0
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._ended = False

    def call(self, *task: Any) -> Any:
        """Carry out one task and return its result, or raise what it raised."""
        if self._left == 0:
            self._replace()
        self._left -= 1
        assert self._pipe is not None and self._process is not None
        try:
            self._pipe.send(task)
            good, value = self._pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            self._left = 0
            raise WorkerDied(_how_it_ended(self._process.exitcode or 0)) from None
        if not good:
            raise value
        return value

    def end(self) -> None:
        """End the process, whatever it is doing; no other will be started."""
        self._ended = True
        if self._process is not None:
            self._process.kill()

    def _replace(self) -> None:
        if self._process is not None and self._pipe is not None:
            self._pipe.close()  # The end of its input: it has nothing to do, and goes.
            self._process.join()
        if self._ended:
            raise WorkerDied("the campaign was stopped")
        for name in ONE_THREAD:
            os.environ.setdefault(name, "1")
        spawn = multiprocessing.get_context("spawn")
        self._pipe, theirs = spawn.Pipe()
        process = self._process = spawn.Process(target=_serve, args=(theirs,), daemon=True)
        process.start()
        theirs.close()  # So that reading ends when the process does.
        self._left = self._tasks
        if self._ended:  # While it was being started.
            process.kill()


def _how_it_ended(code: int) -> str:
    if code >= 0:
        return f"its process ended with exit code {code}"
    with suppress(ValueError):
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process was ended by signal {-code}"


def _serve(pipe: Connection) -> None:
    """Carry out tasks until there are no more, or until the process that gave them is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # The process that gave the tasks decides.
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            fn, args, kwargs = pipe.recv()
        except EOFError:
            return
        try:
            answer = True, fn(*args, **kwargs)
        except Exception as error:
            answer = False, error
        pipe.send(answer)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def death_of(error: BaseException) -> str | None:
    """Return how a trial's process ended; None if the error is another one."""
    if isinstance(error, WorkerDied):
        return str(error)
    # Dask gives a trial whose worker was killed to others, and gives up after some.
    return "its workers were killed, one after another" if _is_dask_death(error) else None


def _is_dask_death(error: BaseException) -> bool:
    return type(error).__module__.startswith("distributed") and "KilledWorker" in {
        kind.__name__ for kind in type(error).__mro__
    }
