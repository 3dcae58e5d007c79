"""The cell's inputs and outputs as ports with names, for a caller's own systems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import (
    Context,
    DiagramBuilder,
    InputPort,
    LeafSystem,
    OutputPort,
    PortDataType,
)

from cell.errors import InputError, UnknownName
from cell.workpieces.parts import Parts


@dataclass(frozen=True)
class Ports:
    """Ports by name.

    Attributes:
        inputs: Each is optional: what is not connected holds what it was told last.
        outputs: What the cell senses; part poses are the truth.
    """

    inputs: dict[str, InputPort] = field(default_factory=dict)
    outputs: dict[str, OutputPort] = field(default_factory=dict)

    def add(self, inputs: Mapping[str, InputPort], outputs: Mapping[str, OutputPort]) -> None:
        """Add ports to both kinds."""
        self.inputs.update(inputs)
        self.outputs.update(outputs)

    def connect(self, builder: DiagramBuilder, source: OutputPort, name: str) -> None:
        """Connect a caller's output to an input of the cell.

        Raises:
            InputError: No such input, something is connected to it already, another size or type,
                a system that is not in this builder, or a builder that has built its diagram.
        """
        if name not in self.inputs:
            raise UnknownName("input of the cell", name, self.inputs)
        port = self.inputs[name]
        mine = f"'{source.get_system().get_name()}.{source.get_name()}'"
        if source.get_data_type() != port.get_data_type() or source.size() != port.size():
            raise InputError(
                f"Input '{name}' of the cell takes {_kind(port)}; {mine} is {_kind(source)}."
            )
        try:
            if builder.IsConnectedOrExported(port):
                raise InputError(f"Input '{name}' of the cell is connected already.")
            builder.Connect(source, port)
        except RuntimeError as error:
            reason = str(error).splitlines()[0]
            raise InputError(f"{mine} cannot be connected to input '{name}': {reason}") from error

    def output(self, name: str) -> OutputPort:
        """Return an output by its name."""
        if name not in self.outputs:
            raise UnknownName("output of the cell", name, self.outputs)
        return self.outputs[name]

    def export(self, builder: DiagramBuilder, prefix: str = "") -> None:
        """Make every port one of the diagram itself, but for inputs that are connected.

        Args:
            builder: The cell's, before it builds the diagram.
            prefix: Of the names, to tell two cells apart.
        """
        for name, port in self.inputs.items():
            if not builder.IsConnectedOrExported(port):
                builder.ExportInput(port, prefix + name)
        for name, port in self.outputs.items():
            builder.ExportOutput(port, prefix + name)


def _kind(port: InputPort | OutputPort) -> str:
    """Return what a port carries."""
    vector = port.get_data_type() == PortDataType.kVectorValued
    return f"a vector of {port.size()}" if vector else "an abstract value"


class PartPoses(LeafSystem):
    """True poses X_WP, one output port ``<name>.pose`` per part.

    Args:
        bodies: By the name of the part.
    """

    def __init__(self, bodies: Mapping[str, RigidBody]) -> None:
        super().__init__()
        poses = AbstractValue.Make([RigidTransform()])
        port = self.DeclareAbstractInputPort("body_poses", poses)
        for name, body in bodies.items():

            def calc(
                context: Context, output: AbstractValue, index: int = int(body.index())
            ) -> None:
                output.set_value(port.Eval(context)[index])

            self.DeclareAbstractOutputPort(
                f"{name}.pose", lambda: AbstractValue.Make(RigidTransform()), calc
            )


def add_part_poses(
    builder: DiagramBuilder, name: str, plant: MultibodyPlant, parts: Parts
) -> dict[str, OutputPort]:
    """Add `PartPoses` under a name, connected to the finalized plant; return its outputs."""
    poses = PartPoses({part.part.name: part.body for part in parts})
    builder.AddNamedSystem(name, poses)
    builder.Connect(plant.get_body_poses_output_port(), poses.get_input_port())
    names = [f"{part.part.name}.pose" for part in parts]
    return {name: poses.GetOutputPort(name) for name in names}
