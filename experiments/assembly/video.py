"""A short video of a run: a GIF of the jig, rendered from the log after the run."""

from __future__ import annotations

from bisect import bisect_right
from pathlib import Path

import numpy as np
from PIL import Image
from pydrake.geometry import GeometryId, Role
from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.fixtures.soft_jig.bed_geometry import MEMBRANE
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.fixtures.soft_jig.visual import membrane_shape
from cell.machines.cameras.rendering import rendering
from cell.whole_file import whole_file
from experiments.assembly.film import Film
from experiments.reporting.render import View
from planning.operations.operation import Arrays

# From over the front edge, close enough to see the bag give way and both hands at work.
VIEW = View(p_WC=(0.42, 0.8, 0.52), p_WTarget=(0.0, 0.13, 0.27), width=480, height=360)
RATE = 10.0  # Pictures per second of the video [1/s] [A].
PACE = 3.0  # How much faster than the run it plays [A].
COLORS = 128  # In the palette of a picture [A].


def write_video(path: Path, cell: Cell, log: Arrays, film: Film) -> None:
    """Write an animated GIF of a run, whole or not at all.

    Args:
        path: Of the file.
        cell: That was run, with its diagram.
        log: All columns of the run, of at least one row.
        film: Surfaces of the jig.

    Raises:
        NoRendering: This machine cannot render.
    """
    assert cell.diagram is not None
    root = cell.diagram.CreateDefaultContext()
    plant_context = cell.plant.GetMyMutableContextFromRoot(root)
    times, membrane, shown = [time for time, _ in film.surfaces], _membrane(cell), -1
    pictures: list[Image.Image] = []
    with rendering(cell.scene_graph, root, shadows=False) as query:
        for row in picture_rows(log["time"]):
            # The first is there from the start.
            surface = max(bisect_right(times, log["time"][row] + 1e-9) - 1, 0)
            if membrane is not None and times and surface != shown:
                _show(cell, root, membrane, film.surfaces[surface][1])
                shown = surface
            cell.plant.SetPositions(plant_context, log["q"][row])
            world = cell.scene_graph.world_frame_id()
            image = query.RenderColorImage(VIEW.camera(), world, VIEW.X_WC)
            picture = Image.fromarray(np.array(image.data[:, :, :3]))
            pictures.append(picture.quantize(COLORS, dither=Image.Dither.NONE))
    with whole_file(path) as temporary:
        pictures[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=pictures[1:],
            duration=round(1e3 / RATE),
            loop=0,
        )


def picture_rows(time: np.ndarray) -> np.ndarray:
    """Return the rows of the log that are pictured; the last one is among them.

    Args:
        time: (n,) [s].
    """
    wanted = np.arange(time[0], time[-1], PACE / RATE)
    rows = np.searchsorted(time, wanted)
    return np.unique([*rows, len(time) - 1])


def _membrane(cell: Cell) -> GeometryId | None:
    """Return the visible surface of a soft jig."""
    inspector = cell.scene_graph.model_inspector()
    for geometry in inspector.GetAllGeometryIds(Role.kPerception):
        if inspector.GetName(geometry).split("::")[-1] == MEMBRANE:
            return geometry
    return None


def _show(cell: Cell, root: Context, membrane: GeometryId, bed: Bed) -> None:
    """Let the membrane look like a surface."""
    context, source = cell.scene_graph.GetMyMutableContextFromRoot(root), cell.plant.get_source_id()
    cell.scene_graph.ChangeShape(context, source, membrane, membrane_shape(bed))
