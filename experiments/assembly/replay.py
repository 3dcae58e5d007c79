"""The cell in a browser: live, or as a recording that plays offline.

Meshcat records how things move, but not how shapes change. The jig's membrane is therefore shown as
a film: every surface that it takes is an object of its own, visible for its time only.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Meshcat,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
)
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem

from cell.builder import Cell
from cell.errors import UnknownName
from cell.fixtures.soft_jig import SoftJig
from cell.fixtures.soft_jig.bed_geometry import MEMBRANE, SILICONE_COLOR
from cell.fixtures.soft_jig.visual import membrane_shape
from cell.simulation.simulation import Simulation
from experiments.assembly.film import Monitor
from experiments.reporting.output import write_text

FRAME_PERIOD = 0.05  # Between two pictures [s] [A].
MEMBRANE_PERIOD = 0.1  # Between two surfaces of the membrane [s] [A]; each costs about 0.3 MB.
# Where it stands and what it looks at, in W [m]: the jig with both hands over it.
CAMERA = ((0.36, 0.7, 0.5), (0.0, 0.13, 0.26))


class MembraneFilm(LeafSystem):
    """Shows the jig's surface each time it has changed.

    Args:
        jig: Whose surface.
        X_WJ: Where the jig stands.
        meshcat: Where to show it.
        still: Path of the surface that the visualizer shows, to be hidden.

    Attributes:
        root: Context of the diagram that is shown; None shows nothing yet.
    """

    def __init__(self, jig: SoftJig, X_WJ: RigidTransform, meshcat: Meshcat, still: str) -> None:
        super().__init__()
        self.jig, self.X_WJ, self.meshcat, self.still = jig, X_WJ, meshcat, still
        self.root: Context | None = None
        self.count = 0
        self._shown: np.ndarray | None = None
        self.DeclarePeriodicPublishEvent(MEMBRANE_PERIOD, 0.0, self._publish)

    def _publish(self, context: Context) -> None:
        if self.root is None:
            return
        bed = self.jig.memory(self.root).bed
        if self._shown is not None and np.array_equal(bed.heights, self._shown):
            return
        self._shown = bed.heights.copy()
        # The first is there from the start: it was found at the first step.
        path, time = f"/membrane/{self.count}", context.get_time() if self.count else 0.0
        self.meshcat.SetObject(path, membrane_shape(bed), Rgba(*SILICONE_COLOR))
        self.meshcat.SetTransform(path, self.X_WJ)
        if self.count:
            self.meshcat.SetProperty(path, "visible", False, 0.0)
            self.meshcat.SetProperty(f"/membrane/{self.count - 1}", "visible", False, time)
        self.meshcat.SetProperty(path, "visible", True, time)
        # Each time: the visualizer forgets it when a simulation is initialized.
        self.meshcat.SetProperty(self.still, "visible", False, 0.0)
        self.count += 1


class Mirror:
    """A monitor that lets a simulation that is drawn look like the one that runs.

    Args:
        running: Not connected to a visualizer.
        drawn: The same bodies, in a diagram with one.
    """

    def __init__(self, running: Simulation, drawn: Simulation) -> None:
        self.running, self.drawn, self.shown = running, drawn, -np.inf

    def __call__(self, root: Context) -> None:
        """Show the bodies, if a picture is due."""
        time = root.get_time()
        if time - self.shown < FRAME_PERIOD - 1e-6:
            return
        self.shown, drawn = time, self.drawn
        drawn.root.SetTime(time)
        q = self.running.cell.plant.GetPositions(self.running.context)
        drawn.cell.plant.SetPositions(drawn.context, q)
        assert drawn.cell.diagram is not None
        drawn.cell.diagram.ForcedPublish(drawn.root)


class Replay:
    """Meshcat for one run; does nothing when neither a view nor a file is wanted.

    Args:
        view: Whether a person watches.
        file: Where to write the recording; None for none.
    """

    def __init__(self, *, view: bool, file: Path | None) -> None:
        self.view, self.file = view, file
        logging.getLogger("drake").setLevel(logging.WARNING)  # Meshcat reports its port.
        # Not on the network: whoever can open the page can also send commands to it.
        params = MeshcatParams(host="localhost", show_stats_plot=False)
        self.meshcat = Meshcat(params) if view or file else None
        self.film: MembraneFilm | None = None
        self._drawn: Simulation | None = None

    @property
    def url(self) -> str | None:
        """Where to watch, if somebody wants to."""
        return self.meshcat.web_url() if self.view and self.meshcat else None

    def add_to(self, builder: DiagramBuilder, cell: Cell) -> None:
        """Connect to a diagram under construction, if it is the first one."""
        if self.meshcat is None or self._drawn is not None:
            return
        params = MeshcatVisualizerParams(publish_period=FRAME_PERIOD)
        MeshcatVisualizer.AddToBuilder(builder, cell.scene_graph, self.meshcat, params)
        if isinstance(cell.fixture, SoftJig):
            still = membrane_path(cell, params.prefix)
            film = MembraneFilm(cell.fixture, cell.X_WJ, self.meshcat, still)
            self.film = builder.AddSystem(film)
        self.meshcat.SetCameraPose(*CAMERA)
        for helper in ("/Axes", "/Grid"):
            self.meshcat.SetProperty(helper, "visible", False)
        if self.file is not None:
            self.meshcat.StartRecording(
                frames_per_second=1.0 / FRAME_PERIOD, set_visualizations_while_recording=self.view
            )

    def follow(self, simulation: Simulation) -> Monitor | None:
        """Show a simulation of the built diagram, or how the same bodies move in another one.

        The membrane is that of the first: it does not change while another one runs.

        Returns:
            What has to be called after each step of the simulation; None: nothing.
        """
        if self.meshcat is None:
            return None
        if self._drawn is not None:
            return Mirror(simulation, self._drawn)
        self._drawn = simulation
        if self.film is not None:
            self.film.root = simulation.root
        return None

    def save(self) -> None:
        """Write the recording, if one is wanted."""
        if self.meshcat is not None and self.file is not None:
            self.meshcat.StopRecording()
            self.meshcat.PublishRecording()
            write_text(self.file, self.meshcat.StaticHtml())


def membrane_path(cell: Cell, prefix: str) -> str:
    """Return where the visualizer puts the membrane that the film stands in for."""
    inspector = cell.scene_graph.model_inspector()
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        name = inspector.GetName(geometry)
        if name.split("::")[-1] == MEMBRANE:
            frame = inspector.GetName(inspector.GetFrameId(geometry))
            return f"{prefix}/{frame}/{name}".replace("::", "/")
    raise UnknownName("visible geometry", MEMBRANE, ())
