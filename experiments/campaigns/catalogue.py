"""The experiments that can be run in campaigns: by name, or functions in files of one's own."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, cast

from cell.errors import InputError, UnknownName
from experiments.campaigns.trial import Outcome

Function = Callable[..., Outcome]
"""Takes a `Task`, then the experiment's own options by keyword; each has a default."""

BUILT_IN = {
    "assemble": "experiments.campaigns.assembly:assemble",
    "place": "experiments.paper.trial_tasks:place",
    "push": "experiments.paper.trial_tasks:push",
    "hold": "experiments.jig.holding:hold",
    "bench": "experiments.calibration.bench:bench",
}


@dataclass(frozen=True)
class Experiment:
    """An experiment that was found.

    Attributes:
        name: "push", or ``FILE.py:FUNCTION`` with the whole path of the file.
        function: Runs one trial.
        script: The file in which the function is.
    """

    name: str
    function: Function
    script: Path

    @property
    def label(self) -> str:
        """Its name without the folder that the file lies in."""
        return Path(self.name).name

    @property
    def options(self) -> Mapping[str, Any]:
        """Its own options with their defaults: what the function takes by keyword only."""
        parameters = inspect.signature(self.function).parameters.values()
        return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


def name_of(function: Function) -> str:
    """Return the name under which `experiment_named` finds a function, in any process.

    Raises:
        InputError: It is not a function at the top of a file.
    """
    if "." in function.__qualname__ or "<" in function.__qualname__:
        raise InputError(f"'{function.__qualname__}' must be a function at the top of its file.")
    return f"{Path(inspect.getfile(function)).resolve()}:{function.__name__}"


@cache
def experiment_named(name: str) -> Experiment:
    """Return an experiment.

    Args:
        name: One of `BUILT_IN`, or ``FILE.py:FUNCTION``.

    Raises:
        InputError: There is none, or it cannot be called as one.
    """
    if name in BUILT_IN:
        module_name, _, function_name = BUILT_IN[name].partition(":")
        module = importlib.import_module(module_name)
    else:
        file, colon, function_name = name.rpartition(":")
        if not colon:
            raise UnknownName("experiment", name, [*BUILT_IN, "FILE.py:FUNCTION"])
        module = _module_of(Path(file).resolve())
        name = f"{Path(file).resolve()}:{function_name}"
    function = getattr(module, function_name, None)
    if not callable(function):
        known = [key for key, value in vars(module).items() if inspect.isfunction(value)]
        raise UnknownName(f"function in '{module.__file__}'", function_name, known)
    experiment = Experiment(name, cast(Function, function), Path(module.__file__ or ""))
    _check(experiment)
    return experiment


def _module_of(file: Path) -> Any:
    """Return a file as a module, under a name of its own: its ``__main__`` part is not run."""
    if not file.is_file():
        raise InputError(f"No file '{file}' with an experiment.")
    name = f"campaign_of_{hashlib.sha256(str(file).encode()).hexdigest()}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise InputError(f"'{file}' is no Python file.")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(f"'{file}' cannot be imported: {type(error).__name__}: {error}") from error
    return module


def _check(experiment: Experiment) -> None:
    parameters = list(inspect.signature(experiment.function).parameters.values())
    if not parameters or parameters[0].kind not in (
        inspect.Parameter.POSITIONAL_ONLY,
        inspect.Parameter.POSITIONAL_OR_KEYWORD,
    ):
        raise InputError(f"'{experiment.label}' must take a Task as its first argument.")
    for parameter in parameters[1:]:
        if parameter.kind is not parameter.KEYWORD_ONLY or parameter.default is parameter.empty:
            raise InputError(
                f"'{experiment.label}': its option '{parameter.name}' must come after a '*' and "
                "have a default."
            )
