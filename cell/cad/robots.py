"""SDF models of everything that moves by itself: arm, gripper, driver."""

from __future__ import annotations

from pathlib import Path

from cell.cad import hand_e, screwdriver, ur5e


def write_models(folder: Path) -> None:
    """Write ur5e, hand_e and screwdriver into ``folder`` (models/sdf)."""
    for module in (ur5e, hand_e, screwdriver):
        module.write_models(folder)
