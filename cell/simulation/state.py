"""Save and restore all state of a run: continuing from a restored state is bit-identical."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cell.simulation.events import press_into_bed
from cell.simulation.simulation import Simulation
from cell.workpieces.thread import ThreadState

State = dict[str, np.ndarray]


def save_state(simulation: Simulation) -> State:
    """Return time, q, v, commands, drive modes, sleep, threads and jig as named arrays."""
    cell, root, context = simulation.cell, simulation.root, simulation.context
    state: State = {
        "steps": np.array(simulation.steps),
        "q": cell.plant.GetPositions(context).copy(),
        "v": cell.plant.GetVelocities(context).copy(),
        "rng": np.array(repr(simulation.sensor.rng.bit_generator.state)),
    }
    for name, drive in _drives(simulation).items():
        state[f"{name}/target"], state[f"{name}/effort"] = drive.values(root)
    for name, arm in cell.arms.items():
        state[f"{name}/torque_drive"] = np.array(arm.in_torque_drive())
        # The latest readings, too: Drake derives them from the step that led here.
        state[f"{name}/wrist"] = simulation.wrists[name].copy()
        state[f"{name}/tare"] = simulation.tare[name].copy()
    state["jig_base/asleep"] = np.array(cell.jig_base.asleep)
    for part in cell.parts:
        state[f"asleep/{part.part.name}"] = np.array(part.asleep)
        state[f"pressing/{part.part.name}"] = np.array(part.body in cell.soft_jig.pressing)
    for name, thread in cell.threads.items():
        state[f"thread/{name}/state"] = np.array(thread.state.value)
        state[f"thread/{name}/caught_angle"] = np.array(thread.caught_angle)
        bit = -1 if thread.bit_position is None else thread.bit_position
        state[f"thread/{name}/bit"] = np.array(bit)
    state.update(_flat(cell.soft_jig.save_state(), "jig"))
    return state


def _flat(nested: Mapping[str, Any], prefix: str) -> State:
    """Return nested dictionaries as one, with paths for names."""
    flat: State = {}
    for name, value in nested.items():
        path = f"{prefix}/{name}"
        flat.update(_flat(value, path) if isinstance(value, Mapping) else {path: np.array(value)})
    return flat


def _nested(flat: State, prefix: str) -> dict[str, Any]:
    """Undo `_flat` for the names under a prefix."""
    nested: dict[str, Any] = {}
    for path, value in flat.items():
        if path.startswith(f"{prefix}/"):
            *folders, name = path.split("/")[1:]
            here = nested
            for folder in folders:
                here = here.setdefault(folder, {})
            here[name] = value
    return nested


def restore_state(simulation: Simulation, state: State) -> None:
    """Put a simulation of the same cell into a saved state."""
    cell, root, context = simulation.cell, simulation.root, simulation.context
    for name, thread in cell.threads.items():
        thread.restore(
            root,
            ThreadState(str(state[f"thread/{name}/state"])),
            None if state[f"thread/{name}/bit"] < 0 else int(state[f"thread/{name}/bit"]),
            float(state[f"thread/{name}/caught_angle"]),
        )
    cell.jig_base.wake(root)
    for part in cell.parts:
        part.wake(root)
        if state[f"pressing/{part.part.name}"]:
            press_into_bed(simulation, part.part.name)
        else:
            cell.soft_jig.release(part.body)
    cell.soft_jig.restore_state(root, _nested(state, "jig"))
    simulation.apply_bed_forces()
    for part in cell.parts:
        if state[f"asleep/{part.part.name}"]:
            part.sleep(root)
    if state["jig_base/asleep"]:
        cell.jig_base.sleep(root)
    for name, arm in cell.arms.items():
        simulation.wrists[name] = state[f"{name}/wrist"]
        simulation.tare[name] = state[f"{name}/tare"]
        (arm.use_torque_drive if state[f"{name}/torque_drive"] else arm.use_position_drive)()
    for name, drive in _drives(simulation).items():
        target, effort = state[f"{name}/target"], state[f"{name}/effort"]
        drive.set_target(root, *np.split(target, 2))
        drive.set_effort(root, effort)
    simulation.steps = int(state["steps"])
    root.SetTime(simulation.time)
    cell.plant.SetPositions(context, state["q"])
    cell.plant.SetVelocities(context, state["v"])
    simulation.sensor.rng.bit_generator.state = _literal(str(state["rng"]))
    simulation.simulator.Initialize()


def _literal(text: str) -> Any:
    """Read back the generator state, a dictionary of numbers and names."""
    return ast.literal_eval(text)


def _drives(simulation: Simulation) -> dict[str, Any]:
    cell = simulation.cell
    return {**cell.drives, "gripper": cell.gripper.drive, "driver": cell.driver.drive}


def write_state(path: Path, state: State) -> None:
    """Write a saved state to a compressed npz."""
    np.savez_compressed(path, allow_pickle=False, **state)


def read_state(path: Path) -> State:
    """Read a saved state from an npz."""
    with np.load(path) as archive:
        return {name: archive[name] for name in archive.files}
