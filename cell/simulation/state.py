"""Save and restore all state of a run: continuing from a restored state is bit-identical.

A saved state is a flat mapping of names to arrays. It also says what it is of: product,
configuration, bodies and Drake's version; and it lists its arrays with their checksums. A state of
another cell, or one that is not whole, is refused before anything is changed.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from cell.errors import InputError
from cell.simulation.simulation import Simulation
from cell.whole_file import whole_file

State = dict[str, np.ndarray]

ARRAYS = "of/arrays"  # The list of names and checksums.
SLASH = "%2F"  # A slash in the name of a part or body, in the path of an array.


def save_state(simulation: Simulation) -> State:
    """Return everything that the course of a run depends on as named arrays."""
    cell, root, context = simulation.cell, simulation.root, simulation.context
    bodies = [part.body for part in cell.parts]
    # A caller's own are among them.
    free = [cell.plant.get_body(index) for index in cell.plant.GetFloatingBaseBodies()]
    asleep = {part.part.name: np.array(part.asleep(root)) for part in cell.parts}
    state: dict[str, Any] = {
        "of": {name: np.array(value) for name, value in simulation.identity.items()},
        "steps": np.array(simulation.steps),
        "q": cell.plant.GetPositions(context).copy(),
        "v": cell.plant.GetVelocities(context).copy(),
        "drive": {name: drive.save(root) for name, drive in cell.drives.items()},
        # Drake derives readings from the step that led here.
        "wrist": {name: reading.copy() for name, reading in simulation.wrists.items()},
        "tare": {name: reading.copy() for name, reading in simulation.tare.items()},
        "asleep": asleep | {"jig_base": np.array(cell.jig_base.asleep(root))},
        "sleep": cell.sleeper.save(root, [*bodies, *free, cell.jig_base.body]),
        "threads": cell.threads.save(root),
        "press_fits": cell.press_fits.save(root),
        "fixture": cell.fixture.save(root),
        "links": cell.links.save(root),
    }
    flat = _flat(state)
    return flat | {ARRAYS: np.array(sorted(_checksums(flat)))}


def restore_state(simulation: Simulation, state: Mapping[str, np.ndarray]) -> None:
    """Put a simulation of the same cell into a saved state.

    Drake derives what the force plate and the outputs of the plant read from a step: they are those
    of the saved run again after the next one.

    Raises:
        InputError: A state of another product, configuration or Drake, or an incomplete or damaged
            one.
    """
    _check_identity(simulation, state)
    names = _check_arrays(state)
    try:
        _restore(simulation, _nested({name: state[name] for name in names}))
    except KeyError as missing:  # It is whole, so another version of this project has saved it.
        raise InputError(f"The saved state lacks {missing}: it is incomplete.") from missing


def hand_over(source: Simulation, target: Simulation) -> None:
    """Put a simulation of the same cell, but with another time step, where one has come to.

    Links are given back, as their springs are made for a time step. The source may take some steps
    more, up to one at which a step of the target can begin.
    """
    while round(source.time / target.time_step, 6) % 1.0 != 0.0:
        source.step()
    source.cell.links.clear(source.root)
    state = save_state(source)
    state["steps"] = np.array(round(source.time / target.time_step))
    _restore(target, _nested(state))
    target.log, target.stepping_cpu = source.log, source.stepping_cpu


def _restore(simulation: Simulation, state: dict[str, Any]) -> None:
    cell, root, context = simulation.cell, simulation.root, simulation.context
    cell.links.clear(root)
    # Sleep is restored in the end; what was asleep before must not keep its locks and filters.
    cell.parts.sleep_all_but(root, cell.parts.by_name)
    cell.jig_base.wake(root)
    cell.sleeper.wake_all(root)
    cell.threads.restore(root, state["threads"])
    cell.press_fits.restore(root, state.get("press_fits", {}))  # Of none nothing is saved.
    cell.fixture.restore(root, state.get("fixture", {}))
    for part in cell.parts:
        if state["asleep"][part.part.name]:
            cell.parts.sleep(root, part.part.name)
    if state["asleep"]["jig_base"]:
        cell.jig_base.sleep(root)
    for name, drive in cell.drives.items():
        drive.restore(root, state["drive"][name])
    simulation.wrists = {name: reading.copy() for name, reading in state["wrist"].items()}
    simulation.tare = {name: reading.copy() for name, reading in state["tare"].items()}
    steps = int(state["steps"])
    root.SetTime(steps * simulation.time_step)
    cell.monitor.counter.set_seen(root, steps)
    cell.sleeper.restore(root, state["sleep"], root.get_time())
    cell.plant.SetPositions(context, state["q"])
    cell.plant.SetVelocities(context, state["v"])
    cell.threads.meet_heads(root)
    cell.links.restore(root, state["links"])
    simulation.simulator.Initialize()


def _check_identity(simulation: Simulation, state: Mapping[str, np.ndarray]) -> None:
    for what, now in simulation.identity.items():
        then = str(state.get(f"of/{what}", "unknown"))
        if then != now:
            raise InputError(f"The saved state is of another {what}: {then}, not {now}.")


def _check_arrays(state: Mapping[str, np.ndarray]) -> list[str]:
    """Return the names of the arrays that were saved; a caller may have added some of their own.

    They keep their order: that of the bodies in the bag is the order in which forces are added.
    """
    if ARRAYS not in state:
        raise InputError(f"The saved state lacks '{ARRAYS}': it is incomplete.")
    saved = set(map(str, np.ravel(state[ARRAYS])))
    for line in sorted(saved - _checksums(state)):
        name = line.rpartition(" ")[0]
        if name not in state:
            raise InputError(f"The saved state lacks '{name}': it is incomplete.")
        raise InputError(f"The saved state is damaged: '{name}' is not what was saved.")
    names = {line.rpartition(" ")[0] for line in saved}
    return [name for name in state if name in names]


def _checksums(state: Mapping[str, np.ndarray]) -> set[str]:
    """Return what identifies each array, but for those in which the state describes itself."""
    lines = set()
    for name, value in state.items():
        if not name.startswith("of/"):
            checksum = zlib.crc32(np.ascontiguousarray(value).tobytes())
            shape = "x".join(map(str, value.shape))
            lines.add(f"{name} {value.dtype.str}:{shape}:{checksum:08x}")
    return lines


def _flat(nested: Mapping[str, Any], prefix: str = "") -> State:
    """Return nested dictionaries as one, with paths for names."""
    flat: State = {}
    for name, value in nested.items():
        path = prefix + name.replace("/", SLASH)
        if isinstance(value, Mapping):
            flat.update(_flat(value, f"{path}/"))
        else:
            flat[path] = np.array(value)
    return flat


def _nested(flat: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Undo `_flat`."""
    nested: dict[str, Any] = {}
    for path, value in flat.items():
        *folders, name = path.split("/")
        here = nested
        for folder in folders:
            here = here.setdefault(folder.replace(SLASH, "/"), {})
        here[name.replace(SLASH, "/")] = value
    return nested


def write_state(path: Path, state: State) -> None:
    """Write a saved state to a compressed npz, whole or not at all."""
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **state)


def read_state(path: Path) -> State:
    """Read a saved state from an npz.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    try:
        with np.load(path) as archive:
            return {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        raise InputError(f"There is no saved state '{path}'.") from None
    except (OSError, TypeError, ValueError, EOFError, BadZipFile, zlib.error) as error:
        raise InputError(f"'{path}' is not a saved state, or it is damaged.") from error
