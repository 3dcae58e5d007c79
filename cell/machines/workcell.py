"""What stands still around the arms: table, riser, force plate, the jig's base, the tray."""

from __future__ import annotations

from dataclasses import dataclass

from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, WeldJoint

from cell.configuration.config import CellConfig
from cell.machines.cameras.marker_board import add_marker_board
from cell.paths import model_url, new_parser


@dataclass(frozen=True)
class Workcell:
    """Handles to it.

    Attributes:
        plate_weld: Under the force plate, where it reads.
        base: The jig's base.
    """

    plate_weld: WeldJoint
    base: RigidBody

    @property
    def plate(self) -> RigidBody:
        """The force plate."""
        return self.plate_weld.child_body()


def add_workcell(plant: MultibodyPlant, config: CellConfig, tray: str | None) -> Workcell:
    """Add table, riser, force plate, jig base and tray to a plant that is not finalized yet.

    Args:
        plant: Not finalized yet.
        config: Where everything is, and whether the base is bolted down.
        tray: Name or URL of the tray's SDF model; None for no tray.
    """
    X_WJ = config.workcell.X_WJ
    _add_static(plant, "table", RigidTransform())
    _add_static(plant, "riser", X_WJ)
    plate_weld = _add_static(plant, "force_plate", X_WJ)
    if config.camera.markers:
        add_marker_board(plant, plate_weld.child_body())
    (instance,) = new_parser(plant).AddModelsFromUrl(model_url("jig_base"))
    base = plant.GetBodyByName("jig_base", instance)
    if config.workcell.jig_base_fixed:
        plant.WeldFrames(plate_weld.frame_on_child(), base.body_frame())
    else:
        plant.SetDefaultFloatingBaseBodyPose(base, X_WJ)
    if tray is not None:
        _add_static(plant, tray, config.workcell.X_WT)
    return Workcell(plate_weld, base)


def _add_static(plant: MultibodyPlant, model: str, X_WM: RigidTransform) -> WeldJoint:
    """Add a one-body model, welded: contact with ``world_body()`` itself crashes some plants."""
    (instance,) = new_parser(plant, model).AddModelsFromUrl(model_url(model))
    body = plant.get_body(plant.GetBodyIndices(instance)[0])
    return plant.WeldFrames(plant.world_frame(), body.body_frame(), X_WM)
