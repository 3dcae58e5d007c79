"""Every number of the cell that a user may want to change, with unit, range and source.

To add one, add a field with `setting(...)` to its section and run `make models`, which writes
``models/config/default.yaml`` again. SI units inside, degrees where the name says ``_deg``.
Source tags: [S] the paper, [R] read in a data sheet or public file, [M] measured, [D] derived,
[A] assumption.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cell.configuration.config_file import changed, parse_overrides, read_config_file
from cell.fixtures.soft_jig.parameters import JigParameters
from cell.setting import setting


@dataclass(frozen=True)
class SimulationConfig:
    """How the physics is stepped and logged."""

    time_step: float = setting(
        1e-3, "s", "Step of the discrete plant; 2 ms slips parts twice as far [M].",
        above=0.0, at_most=0.005,
    )  # fmt: skip
    contact_approximation: str = setting(
        "lagged", "", "Drake's discrete contact approximation; thresholds of holding differ [M].",
        choices=("lagged", "similar", "sap"),
    )  # fmt: skip
    log_period: float = setting(0.01, "s", "Time between two samples of the log [A].", above=0.0)


@dataclass(frozen=True)
class ArmConfig:
    """Where an arm stands, how it waits and how stiff its position drive is."""

    p_WB: tuple[float, float, float] = setting((0.0, 0.0, 0.0), "m", "Base origin in W [A].")
    rpy_deg: tuple[float, float, float] = setting((0.0, 0.0, 0.0), "deg", "Base in W [A].")
    home_deg: tuple[float, ...] = setting(
        (0.0, -110.0, 100.0, -80.0, -90.0, 0.0), "deg",
        "Joint angles to wait in, base to flange: forearm 10 deg up, tool down [A].",
        at_least=-360.0, at_most=360.0,
    )  # fmt: skip
    stiffness: tuple[float, ...] = setting(
        (2e4, 2e4, 2e4, 5e3, 5e3, 5e3), "N m/rad", "Position drive; stable at any gain [A].",
        above=0.0,
    )  # fmt: skip
    damping: tuple[float, ...] = setting(
        (500.0, 500.0, 300.0, 60.0, 60.0, 60.0), "N m s/rad", "About critical, arm stretched [D].",
        above=0.0,
    )  # fmt: skip

    @property
    def X_WB(self) -> RigidTransform:
        """Pose of the base."""
        return RigidTransform(RollPitchYaw(np.deg2rad(self.rpy_deg)), np.array(self.p_WB))


@dataclass(frozen=True)
class WorkcellConfig:
    """Where jig and tray are."""

    p_WJ: tuple[float, float, float] = setting(
        (0.0, 0.15, 0.20), "m", "Jig origin (top of its base plate) in W; the riser is below [A]."
    )
    jig_base_fixed: bool = setting(
        True, "", "Bolted down (true) or free on the force plate (false), as in push tests [S]."
    )
    p_WT: tuple[float, float, float] = setting((-0.28, 0.42, 0.03), "m", "Tray origin in W [A].")
    tray_yaw_deg: float = setting(0.0, "deg", "Tray about the vertical [A].")

    @property
    def X_WJ(self) -> RigidTransform:
        """Pose of the jig frame while its base is where it was set down."""
        return RigidTransform(np.array(self.p_WJ))

    @property
    def X_WT(self) -> RigidTransform:
        """Nominal pose of the tray."""
        rpy = RollPitchYaw(0.0, 0.0, np.deg2rad(self.tray_yaw_deg))
        return RigidTransform(rpy, np.array(self.p_WT))


@dataclass(frozen=True)
class DriverConfig:
    """The electric screwdriver."""

    free_speed: float = setting(
        80.0, "rad/s", "Spindle while the bolt runs down: 760 rpm [A].", above=0.0
    )
    seat_speed: float = setting(
        7.0, "rad/s", "Spindle when the head is near its seat; faster overshoots [M].", above=0.0
    )
    push_force: float = setting(
        10.0, "N", "Thrust on the bit, 5 to 15 [A].", above=0.0, at_most=50.0
    )
    counter_hold: bool = setting(
        True, "", "The left hand holds the clamped part against the torque; else the jig alone."
    )


@dataclass(frozen=True)
class PlacementConfig:
    """Pressing a part into the soft bed."""

    press_force: float = setting(
        20.0, "N", "Downward force that ends the pressing [A].", above=0.0, at_most=100.0
    )


@dataclass(frozen=True)
class PushConfig:
    """The paper's push experiment: one set of numbers for all cases and both parts."""

    jig_mass: float = setting(
        1.5, "kg", "Base and beads; not in the paper, range 1 to 3 [A].", above=0.45
    )
    base_friction: float = setting(
        0.4, "", "Of the base on the force plate, range 0.3 to 0.6 [A].", above=0.0, at_most=2.0
    )
    speed: float = setting(
        0.28, "m/s", "At the end of the push: coasting by 8 mm past 70 [S] asks for 0.22 to 0.29"
        " [D].", above=0.0, at_most=1.0,
    )  # fmt: skip
    acceleration: float = setting(
        1.0, "m/s2", "Of the hand from rest: up to speed in 39 mm of the 70 [A].", above=0.0
    )
    stroke: float = setting(0.070, "m", "Of the straight push [S].", above=0.0, at_most=0.15)
    start_gap: float = setting(
        2e-3, "m", "Between hand and part at the start [A].", at_least=0.0, at_most=0.02
    )
    height_fraction: float = setting(
        0.6, "", "Lowest point of the fingers over the exposed height of the pushed face [A].",
        above=0.0, at_most=1.0,
    )  # fmt: skip
    bed_clearance: float = setting(
        2e-3, "m", "The fingers stay at least this far above the bed [A].", at_least=0.0
    )
    grasp_position_sigma: float = setting(
        5e-4, "m", "Standard deviation of the part in the grasp, per axis [A].", at_least=0.0
    )
    grasp_angle_sigma_deg: float = setting(
        1.0, "deg", "Standard deviation of the part in the grasp, per axis [A].", at_least=0.0
    )
    jig_position_sigma: float = setting(
        1e-3, "m", "Standard deviation of the jig's place, along x and y [A].", at_least=0.0
    )


@dataclass(frozen=True)
class MotionConfig:
    """Free motion of the arms."""

    velocity_scale: float = setting(
        0.5, "", "Share of the joint speed limits; slip in the jaws grows with it [M].",
        above=0.0, at_most=1.0,
    )  # fmt: skip
    acceleration_limit: float = setting(6.0, "rad/s2", "Of every joint [A].", above=0.0)
    arm_clearance: float = setting(0.01, "m", "Kept between the arms [A].", at_least=0.0)
    obstacle_clearance: float = setting(
        0.005, "m", "Kept between robot and surroundings [A].", at_least=0.0
    )
    max_iterations: int = setting(20000, "", "Of the sampling planner, per path [A].", at_least=1)


@dataclass(frozen=True)
class InsertionConfig:
    """Compliant insertion of a shaft or boss into its hole."""

    force_limit: float = setting(
        10.0, "N", "Largest downward force; above it a sharp edge is squeezed in [M].",
        above=0.0, at_most=30.0,
    )  # fmt: skip
    lateral_stiffness: float = setting(
        4000.0, "N/m", "Of the compliance centred on the hole, 3000 to 6000 work [M].", above=0.0
    )
    rotational_stiffness: float = setting(
        5.0, "N m/rad", "Stiffer leaves the plate tilted on the motor [M].", above=0.0
    )
    speed: float = setting(0.012, "m/s", "Of the descent [A].", above=0.0, at_most=0.1)
    landing_speed: float = setting(
        3e-3, "m/s", "Around the seat, which is stiff: 20 mm/s strike it with 40 N [M].",
        above=0.0, at_most=0.1,
    )  # fmt: skip
    search_force: float = setting(3.0, "N", "Downward during the spiral [M].", above=0.0)
    search_pitch: float = setting(
        1.5e-4, "m", "Of the spiral, about twice the radial clearance [M].", above=0.0
    )
    search_speed: float = setting(5e-3, "m/s", "Along the spiral [A].", above=0.0)
    search_radius: float = setting(1.5e-3, "m", "Where the search gives up [A].", above=0.0)


@dataclass(frozen=True)
class DisturbanceConfig:
    """What is not where it should be; drawn once per run from the seed."""

    tray_position_sigma: float = setting(
        5e-4, "m", "Standard deviation of the tray's place along x and y: set down by hand [A].",
        at_least=0.0,
    )  # fmt: skip
    tray_yaw_sigma_deg: float = setting(
        1.0, "deg", "Standard deviation of the tray about the vertical [A].", at_least=0.0
    )


@dataclass(frozen=True)
class SensorConfig:
    """Noise of the sensed poses of parts."""

    position_noise: float = setting(0.0, "m", "Standard deviation per axis [A].", at_least=0.0)
    angle_noise_deg: float = setting(
        0.0, "deg", "Standard deviation about each axis [A].", at_least=0.0
    )


@dataclass(frozen=True)
class CellConfig:
    """The whole configuration, one section per machine or activity."""

    simulation: SimulationConfig = SimulationConfig()
    left_arm: ArmConfig = ArmConfig(
        p_WB=(-0.45, 0.0, 0.0), home_deg=(180.0, -110.0, 100.0, -80.0, -90.0, 0.0)
    )
    right_arm: ArmConfig = ArmConfig(
        p_WB=(0.45, 0.0, 0.0), home_deg=(60.0, -110.0, 110.0, -90.0, -90.0, 0.0)
    )
    workcell: WorkcellConfig = WorkcellConfig()
    driver: DriverConfig = DriverConfig()
    jig: JigParameters = JigParameters()
    placement: PlacementConfig = PlacementConfig()
    push: PushConfig = PushConfig()
    motion: MotionConfig = MotionConfig()
    insertion: InsertionConfig = InsertionConfig()
    disturbance: DisturbanceConfig = DisturbanceConfig()
    sensor: SensorConfig = SensorConfig()

    @staticmethod
    def load(
        name_or_path: str | Path = "default",
        overrides: Mapping[str, Any] | Sequence[str] = (),
    ) -> CellConfig:
        """Return the defaults, changed by a YAML file, changed by single overrides.

        Args:
            name_or_path: A name in ``models/config`` or a YAML file; it may be partial.
            overrides: Dotted path -> value, or texts such as "simulation.time_step=0.002".
        """
        config = changed(CellConfig(), read_config_file(name_or_path))
        return changed(config, parse_overrides(overrides))

    def to_dict(self) -> dict[str, Any]:
        """Return the configuration as nested dictionaries of plain values."""
        return asdict(self)
