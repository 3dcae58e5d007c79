"""What exists: products, arms, tools, fixtures, threads and sensors as one Drake diagram.

What is named in `__all__` is for users:

- `build_cell` makes the cell as a diagram of its own, `add_cell` puts it into yours; both return a
  `Cell` with handles. `CellConfig` holds every number, `load_product` reads what is assembled.
- `Simulation` steps a cell through `Phase` values; `events` are what a phase can start with.
- `save_state` and `restore_state` keep all state of a run, `write_state` and `read_state` its file.
- `ARM_MODELS`, `GRIPPER_MODELS` and `FIXTURES` are the registries to add to.

The folders, from the lowest up:

- `products`: what is assembled, and reading it from files.
- `fixtures`: what holds a part, the soft jig and others.
- `configuration`: every number, from code, files and the command line.
- `machines`: arms, grippers, the screwdriver, sensors, the jig's base.
- `workpieces`: a product's parts and threads in the plant.
- `cad`: geometry of the models, ``python -m cell.cad``.
- `simulation`: phases, log, saved states.

A test keeps their imports pointing down.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cell.builder import Cell, add_cell, build_cell
    from cell.configuration.config import CellConfig
    from cell.configuration.machines import ArmConfig
    from cell.errors import CellError, InputError, RunFailure, UnknownName
    from cell.fixtures import FIXTURES
    from cell.fixtures.base import Fixture, FixtureError
    from cell.fixtures.flat_plate import FlatPlate
    from cell.machines.arm import Arm
    from cell.machines.arms import ARM_MODELS
    from cell.machines.arms.base import ArmModel, Link
    from cell.machines.driver import Driver
    from cell.machines.gripper import Gripper
    from cell.machines.grippers import GRIPPER_MODELS
    from cell.machines.grippers.base import Fingertips, GripperModel
    from cell.monitor import join_monitors
    from cell.products.joints import Fit, Press, Rest, Screw
    from cell.products.loading import load_product
    from cell.products.product import Grasp, Part, Product
    from cell.products.read_options import ReadOptions
    from cell.simulation import events
    from cell.simulation.phase import (
        Follow,
        Impedance,
        Jaw,
        Outcome,
        Phase,
        PhaseFailed,
        Sensed,
        Spin,
        after,
        motion_finished,
    )
    from cell.simulation.simulation import Simulation
    from cell.simulation.state import read_state, restore_state, save_state, write_state
    from cell.workpieces.thread import ThreadState

    __version__: str

__all__ = [
    "ARM_MODELS",
    "Arm",
    "ArmConfig",
    "ArmModel",
    "Cell",
    "CellConfig",
    "CellError",
    "Driver",
    "FIXTURES",
    "Fingertips",
    "Fit",
    "Fixture",
    "FixtureError",
    "FlatPlate",
    "Follow",
    "GRIPPER_MODELS",
    "Grasp",
    "Gripper",
    "GripperModel",
    "Impedance",
    "InputError",
    "Jaw",
    "Link",
    "Outcome",
    "Part",
    "Phase",
    "PhaseFailed",
    "Press",
    "Product",
    "ReadOptions",
    "Rest",
    "RunFailure",
    "Screw",
    "Sensed",
    "Simulation",
    "Spin",
    "ThreadState",
    "UnknownName",
    "__version__",
    "add_cell",
    "after",
    "build_cell",
    "events",
    "join_monitors",
    "load_product",
    "motion_finished",
    "read_state",
    "restore_state",
    "save_state",
    "write_state",
]

# Looked up on first use: Drake takes a second that `cell.errors` and `--help` can do without.
_HOME = {
    "ARM_MODELS": "cell.machines.arms",
    "Arm": "cell.machines.arm",
    "ArmConfig": "cell.configuration.machines",
    "ArmModel": "cell.machines.arms.base",
    "Cell": "cell.builder",
    "CellConfig": "cell.configuration.config",
    "CellError": "cell.errors",
    "Driver": "cell.machines.driver",
    "FIXTURES": "cell.fixtures",
    "Fingertips": "cell.machines.grippers.base",
    "Fit": "cell.products.joints",
    "Fixture": "cell.fixtures.base",
    "FixtureError": "cell.fixtures.base",
    "FlatPlate": "cell.fixtures.flat_plate",
    "Follow": "cell.simulation.phase",
    "GRIPPER_MODELS": "cell.machines.grippers",
    "Grasp": "cell.products.product",
    "Gripper": "cell.machines.gripper",
    "GripperModel": "cell.machines.grippers.base",
    "Impedance": "cell.simulation.phase",
    "InputError": "cell.errors",
    "Jaw": "cell.simulation.phase",
    "Link": "cell.machines.arms.base",
    "Outcome": "cell.simulation.phase",
    "Part": "cell.products.product",
    "Phase": "cell.simulation.phase",
    "PhaseFailed": "cell.simulation.phase",
    "Press": "cell.products.joints",
    "Product": "cell.products.product",
    "ReadOptions": "cell.products.read_options",
    "Rest": "cell.products.joints",
    "RunFailure": "cell.errors",
    "Screw": "cell.products.joints",
    "Sensed": "cell.simulation.phase",
    "Simulation": "cell.simulation.simulation",
    "Spin": "cell.simulation.phase",
    "ThreadState": "cell.workpieces.thread",
    "UnknownName": "cell.errors",
    "add_cell": "cell.builder",
    "after": "cell.simulation.phase",
    "build_cell": "cell.builder",
    "join_monitors": "cell.monitor",
    "load_product": "cell.products.loading",
    "motion_finished": "cell.simulation.phase",
    "read_state": "cell.simulation.state",
    "restore_state": "cell.simulation.state",
    "save_state": "cell.simulation.state",
    "write_state": "cell.simulation.state",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        try:
            return version("soft-jig-cell")
        except PackageNotFoundError:  # Run from the sources, without an installation.
            return "unknown"
    if name == "events":
        return import_module("cell.simulation.events")
    if name not in _HOME:
        raise AttributeError(f"module 'cell' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
