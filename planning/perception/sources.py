"""The perception sources by their names, and what each begins with."""

from __future__ import annotations

from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.configuration.activities import BLIND, CAMERA, TRUTH
from cell.configuration.config import CellConfig
from cell.errors import UnknownName
from cell.machines.cameras.rendering import NoRendering, rendering_problem
from planning.perception.belief import Estimate, Source, TruthSource
from planning.perception.hand_eye import HandEye
from planning.perception.layout import Blind, parts_in_tray, tray_expected

SOURCES = (TRUTH, CAMERA, BLIND)


def check_source(name: str) -> None:
    """Refuse the name of a source that does not exist.

    Raises:
        UnknownName: There is no such source.
    """
    if name not in SOURCES:
        raise UnknownName("sensor (sensor.source)", name, SOURCES)


def source_of(
    cell: Cell, root: Context, config: CellConfig, seed: int
) -> tuple[Source, dict[str, Estimate]]:
    """Return the source that a configuration names, and what is believed before the first look.

    The truth needs no expectation; the others begin with every part in its place in the tray.

    Args:
        cell: The cell.
        root: Context of its diagram.
        config: What the planner believes the cell to be.
        seed: Of noise.

    Raises:
        UnknownName: There is no such source.
        NoRendering: This machine cannot render what a camera sees.
    """
    name = config.sensor.source
    check_source(name)
    if name == TRUTH:
        return TruthSource.of(cell, root, seed), {}
    expected = parts_in_tray(cell.product, tray_expected(config))
    if name == BLIND:
        return Blind(), expected
    if reason := rendering_problem():
        raise NoRendering(f"Sensor '{CAMERA}' needs pictures: {reason}")
    return HandEye.of(cell, root, config, seed), expected
