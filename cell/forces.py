"""External forces on bodies of a plant, as Drake's input port takes them, and as arrays."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, LeafSystem


def applied_force(
    body: BodyIndex, p_BoBq_B: np.ndarray, F_Bq_W: SpatialForce
) -> ExternallyAppliedSpatialForce:
    """Return a force on a body B at its point Bq."""
    applied = ExternallyAppliedSpatialForce()
    applied.body_index = body
    applied.p_BoBq_B = p_BoBq_B
    applied.F_Bq_W = F_Bq_W
    return applied


def forces_to_rows(forces: Iterable[ExternallyAppliedSpatialForce]) -> np.ndarray:
    """Return body index, p_BoBq_B [m], torque [N m] and force [N] of each in a row (n, 10)."""
    rows = [
        np.concatenate(
            [
                [float(int(force.body_index))],
                force.p_BoBq_B,
                force.F_Bq_W.rotational(),
                force.F_Bq_W.translational(),
            ]
        )
        for force in forces
    ]
    return np.array(rows).reshape(-1, 10)


def forces_from_rows(rows: np.ndarray) -> list[ExternallyAppliedSpatialForce]:
    """Undo `forces_to_rows`."""
    return [
        applied_force(BodyIndex(int(row[0])), row[1:4], SpatialForce(row[4:7], row[7:10]))
        for row in rows
    ]


def no_forces() -> AbstractValue:
    """Return the value of a port that carries forces."""
    return AbstractValue.Make([ExternallyAppliedSpatialForce()])


class ForceSum(LeafSystem):
    """Joins the forces of several systems for the one input port of the plant.

    Input ports, any of which may be left open: as named. Output port ``forces``.

    Args:
        names: Of the input ports.
    """

    def __init__(self, names: Iterable[str]) -> None:
        super().__init__()
        self._inputs = [self.DeclareAbstractInputPort(name, no_forces()) for name in names]
        self.DeclareAbstractOutputPort(
            "forces", no_forces, self._calc, {self.all_input_ports_ticket()}
        )

    def fix(self, root: Context, name: str, forces: list[ExternallyAppliedSpatialForce]) -> None:
        """Give an input that nothing is connected to a value, in a Context of the diagram."""
        self.GetInputPort(name).FixValue(self.GetMyMutableContextFromRoot(root), forces)

    def _calc(self, context: Context, output: AbstractValue) -> None:
        ports = (port for port in self._inputs if port.HasValue(context))
        output.set_value([force for port in ports for force in port.Eval(context)])
