"""The whole configuration of a cell as one frozen value.

To add a setting, add a field with `setting(...)` to its section and run `make models`, which writes
``models/config/default.yaml`` and ``docs/reference/parameters.md`` again. SI units inside, degrees
where the name says ``_deg``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cell.configuration.activities import (
    CAMERA,
    DisturbanceConfig,
    InsertionConfig,
    MotionConfig,
    PlacementConfig,
    PushConfig,
    SensorConfig,
)
from cell.configuration.config_file import parse_overrides, read_config_file
from cell.configuration.frozen_dict import FrozenDict
from cell.configuration.machines import (
    ArmConfig,
    CameraConfig,
    DriverConfig,
    SimulationConfig,
    WorkcellConfig,
)
from cell.configuration.sections import changed
from cell.fixtures.custom.parameters import CustomParameters
from cell.fixtures.soft_jig.parameters import JigParameters


@dataclass(frozen=True)
class CellConfig:
    """The whole configuration, one section per machine or activity.

    Attributes:
        arms: By name. A plain dictionary given to the constructor is frozen.
    """

    simulation: SimulationConfig = SimulationConfig()
    arms: Mapping[str, ArmConfig] = FrozenDict(
        left=ArmConfig(tool="hand_e", p_WB=(-0.45, 0.0, 0.0), home_pan_deg=180.0),
        right=ArmConfig(tool="screwdriver", p_WB=(0.45, 0.0, 0.0), home_pan_deg=60.0),
    )
    workcell: WorkcellConfig = WorkcellConfig()
    driver: DriverConfig = DriverConfig()
    jig: JigParameters = JigParameters()
    custom: CustomParameters = CustomParameters()
    placement: PlacementConfig = PlacementConfig()
    push: PushConfig = PushConfig()
    motion: MotionConfig = MotionConfig()
    insertion: InsertionConfig = InsertionConfig()
    disturbance: DisturbanceConfig = DisturbanceConfig()
    sensor: SensorConfig = SensorConfig()
    camera: CameraConfig = CameraConfig()

    @property
    def hand_eye(self) -> bool:
        """Whether the hand carries a camera: it is mounted, or it is what the cell senses with."""
        return self.camera.mounted or self.sensor.source == CAMERA

    def __post_init__(self) -> None:
        object.__setattr__(self, "arms", FrozenDict(self.arms))

    @staticmethod
    def load(
        name_or_path: str | Path = "default",
        overrides: Mapping[str, Any] | Sequence[str] = (),
    ) -> CellConfig:
        """Return the defaults, changed by a YAML file, changed by single overrides.

        Args:
            name_or_path: A name in ``models/config`` or a YAML file; it may be partial.
            overrides: Dotted path -> value, or texts such as "simulation.time_step=0.0005" and
                "arms.left.model=ur10e".

        Raises:
            UnknownName: No such file or key, with those that exist.
            InputError: The file cannot be read.
            BadSetting: A value that is impossible.
            BadJig: Numbers of the jig that contradict each other.
        """
        config = changed(CellConfig(), read_config_file(name_or_path))
        return config.with_changes(overrides)

    def with_changes(self, overrides: Mapping[str, Any] | Sequence[str]) -> CellConfig:
        """Return the configuration with single values changed and checked, as `load` does."""
        return changed(self, parse_overrides(overrides))

    def to_dict(self) -> dict[str, Any]:
        """Return the configuration as nested dictionaries of plain values."""
        data = asdict(self)
        return data | {"arms": dict(data["arms"])}
