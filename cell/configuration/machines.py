"""Settings of what stands in the cell: how it is stepped, arms, layout, screwdriver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from cell.fixtures.jig_dimensions import J_HEIGHT
from cell.setting import setting


@dataclass(frozen=True)
class SimulationConfig:
    """How the physics is stepped and logged."""

    time_step: float = setting(
        1e-3, "s", "Step of the discrete plant.",
        "[M] At 2 ms parts slip twice as far.",
        above=0.0, at_most=0.005,
    )  # fmt: skip
    contact_approximation: str = setting(
        "lagged", "", "Drake's discrete contact approximation.",
        "[M] Thresholds of holding differ between them.",
        choices=("lagged", "similar", "sap"),
    )  # fmt: skip
    contact: str = setting(
        "linked", "", "Whether contacts that stick become springs (linked) or stay areas (full).",
        "[M] Linked takes a third of the time: `python -m experiments.contact_study`.",
        choices=("full", "linked"),
    )  # fmt: skip
    coarse_factor: int = setting(
        2, "", "Steps are so many times as long in operations that allow it, with linked contact.",
        "[M] Inserting and placing bolts: forces within 1 % at 2 ms; in full contact bolts slip.",
        at_least=1, at_most=4,
    )  # fmt: skip
    log_period: float = setting(
        0.01, "s", "Time between two samples of the log.",
        "[A] Own choice.",
        above=0.0, at_most=10.0,
    )  # fmt: skip

    @property
    def coarse_time_step(self) -> float:
        """Time step of operations that allow a coarse one [s].

        Full contact is always stepped finely: what sticks creeps in proportion to the step.
        """
        return self.time_step * (self.coarse_factor if self.contact == "linked" else 1)


@dataclass(frozen=True)
class ArmConfig:
    """One arm: its model, its tool, where it stands, how it waits, its position drive.

    `home_deg`, `stiffness` and `damping` have one number per joint, from base to flange; empty,
    they are the arm model's own.
    """

    model: str = setting(
        "ur5e", "", "Name of the arm model.",
        "[A] Own choice.",
    )  # fmt: skip
    tool: str = setting(
        "hand_e", "", "Name of the gripper or screwdriver on the flange.",
        "[A] Own choice: one arm holds, the other drives bolts.",
    )  # fmt: skip
    p_WB: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "m", "Origin of the base B in W.",
        "[A] Own choice: the bases are 0.9 m apart.",
        at_least=-10.0, at_most=10.0,
    )  # fmt: skip
    rpy_deg: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "deg", "Roll, pitch and yaw of the base in W.",
        "[A] Own choice.",
        at_least=-360.0, at_most=360.0,
    )  # fmt: skip
    home_pan_deg: float = setting(
        0.0, "deg", "Angle of the first joint where the arm waits, if home_deg is empty.",
        "[A] Own choice.",
        at_least=-360.0, at_most=360.0,
    )  # fmt: skip
    home_deg: tuple[float, ...] = setting(
        (), "deg", "All joint angles to wait in; empty: those of the arm model for the kind of "
        "tool, with home_pan_deg.",
        "[A] The models' own: forearm 10 deg up, tool down.",
        at_least=-360.0, at_most=360.0,
    )  # fmt: skip
    stiffness: tuple[float, ...] = setting(
        (), "N m/rad", "Stiffness of the position drive, per joint; empty: the arm model's own.",
        "[A] The models' own; stable at any gain.",
        above=0.0, at_most=1e7,
    )  # fmt: skip
    damping: tuple[float, ...] = setting(
        (), "N m s/rad", "Damping of the position drive, per joint; empty: the arm model's own.",
        "[D] The models' own: about critical, arm stretched.",
        above=0.0, at_most=1e6,
    )  # fmt: skip

    @property
    def X_WB(self) -> RigidTransform:
        """Pose of the base."""
        return RigidTransform(RollPitchYaw(np.deg2rad(self.rpy_deg)), np.array(self.p_WB))


@dataclass(frozen=True)
class WorkcellConfig:
    """Which fixture there is, and where jig and tray are."""

    fixture: str = setting(
        "soft_jig", "", "Name of the fixture that parts are placed on.",
        "[S] The paper's soft jig.",
    )  # fmt: skip
    p_WJ: tuple[float, float, float] = setting(
        (0.0, 0.15, J_HEIGHT), "m", "Jig origin (centre of the base plate's top face) in W; the "
        "riser is below.",
        "[A] In the reach of both arms; the riser's model is made for this height.",
        at_least=-2.0, at_most=2.0,
    )  # fmt: skip
    jig_base_fixed: bool = setting(
        True, "", "Whether the jig's base is bolted down, or free on the force plate.",
        "[S] Free in the push tests.",
    )  # fmt: skip
    p_WT: tuple[float, float, float] = setting(
        (-0.28, 0.42, 0.03), "m", "Tray origin T in W.",
        "[A] Own choice.",
        at_least=-2.0, at_most=2.0,
    )  # fmt: skip
    tray_yaw_deg: float = setting(
        0.0, "deg", "Rotation of the tray about the vertical.",
        "[A] Own choice.",
        at_least=-360.0, at_most=360.0,
    )  # fmt: skip

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
        80.0, "rad/s", "Speed of the spindle while the bolt runs down.",
        "[A] 760 rpm.",
        above=0.0, at_most=300.0,
    )  # fmt: skip
    seat_speed: float = setting(
        8.0, "rad/s", "Speed of the spindle when the head is near its seat, at most: each bolt "
        "has the speed of which enough is left at its torque (`TRIP_SPEED`).",
        "[A] Tightens M3 to 0.6 N m.",
        above=0.0, at_most=300.0,
    )  # fmt: skip
    push_force: float = setting(
        10.0, "N", "Thrust on the bit.",
        "[A] 10, plausible 5-15.",
        above=0.0, at_most=50.0,
    )  # fmt: skip
    search_radius: float = setting(
        1.5e-3, "m", "How far from where a bolt is believed to stand its socket is searched for, "
        "at least; where three standard deviations of the belief are more, as far as these.",
        "[A] A bolt may stand 1 mm off its thread (standing_lateral_m); as much as insertion.",
        at_least=0.0, at_most=0.01,
    )  # fmt: skip
    counter_hold: bool = setting(
        True, "", "Whether the gripper holds the clamped part against the torque; else the jig "
        "alone.",
        "[M] The jig alone carries about 0.27 N m; then the part turns in its imprint.",
    )  # fmt: skip


@dataclass(frozen=True)
class CameraConfig:
    """The depth cameras: one on the hand that grips, if it is mounted, one fixed above the jig."""

    mounted: bool = setting(
        False, "", "Whether the hand carries a camera, in the collision model, too; with "
        "sensor.source=camera it does.",
        "[S] The paper's discussion: a hand-eye RealSense D435.",
    )  # fmt: skip
    p_MC: tuple[float, float, float] = setting(
        (0.0, 0.075, 0.035), "m", "Camera on the hand: its origin in the tool's frame mount.",
        "[M] Above the hand where that presses a standing motor in from the side; on the other "
        "side it would meet the force plate. Looks from 45 to 88 deg above are reachable.",
        at_least=-0.3, at_most=0.3,
    )  # fmt: skip
    tilt_deg: float = setting(
        15.0, "deg", "By how much its axis is tilted towards the fingers.",
        "[M] As p_MC; the fingers fill the lower fifth of the image.",
        at_least=-90.0, at_most=90.0,
    )  # fmt: skip
    markers: bool = setting(
        False, "", "Whether a board of printed markers lies around the jig; it is only seen.",
        "[S] The paper's discussion: data are collected with visual markers.",
    )  # fmt: skip
    height_above_jig: float = setting(
        0.5, "m", "Height of the fixed camera above the jig.",
        "[A] Own choice: the paper gives none.",
        above=0.1, at_most=3.0,
    )  # fmt: skip
    width: int = setting(
        848, "", "Of the image in pixels.",
        "[R] D400 data sheet: the depth resolution it is made for.",
        at_least=64, at_most=1920,
    )  # fmt: skip
    height: int = setting(
        480, "", "Of the image in pixels.",
        "[R] D400 data sheet.",
        at_least=48, at_most=1200,
    )  # fmt: skip
    focal_length: float = setting(
        424.0, "", "In pixels.",
        "[R] Half of 848 pixels at a horizontal field of view of 90 deg, Grunnet-Jepsen et al., "
        "Subpixel linearity improvement for Intel RealSense depth cameras.",
        above=10.0, at_most=5000.0,
    )  # fmt: skip
    baseline: float = setting(
        0.05, "m", "Between the two infrared imagers.",
        "[R] D400 data sheet: 50 mm.",
        above=0.0, at_most=1.0,
    )  # fmt: skip
    disparity_noise: float = setting(
        0.08, "", "Standard deviation of the disparity in pixels.",
        "[R] 0.05 to 0.1 on textured surfaces, Intel's tuning guide for D400 cameras.",
        at_least=0.0, at_most=10.0,
    )  # fmt: skip
    disparity_step: float = setting(
        1.0 / 32.0, "", "Smallest difference of two disparities in pixels.",
        "[R] D400 data sheet: 5 subpixel bits.",
        above=0.0, at_most=10.0,
    )  # fmt: skip
    largest_disparity: float = setting(
        126.0, "", "Disparities up to this are searched, in pixels: nothing nearer has a depth.",
        "[R] D400 data sheet; with it the least depth is 0.168 m.",
        above=1.0, at_most=1000.0,
    )  # fmt: skip
    disparity_bias: float = setting(
        0.0, "", "Constant error of the disparity in pixels: a decalibrated camera.",
        "[A] None; 0.1 moves a surface at 0.3 m by 0.4 mm.",
        at_least=-5.0, at_most=5.0,
    )  # fmt: skip
    edge_loss: float = setting(
        0.5, "", "Share of the pixels at an edge that have no depth.",
        "[A] 0.5, plausible 0.3 to 1.",
        at_least=0.0, at_most=1.0,
    )  # fmt: skip
    dropouts: float = setting(
        0.01, "", "Share of all pixels that have no depth.",
        "[A] 1 % on matt surfaces, plausible 0.2 to 5 %.",
        at_least=0.0, at_most=1.0,
    )  # fmt: skip

    @property
    def X_MC(self) -> RigidTransform:
        """Pose of the camera C on the hand in the frame M, mount, of its tool."""
        tilt = RotationMatrix.MakeXRotation(-np.deg2rad(self.tilt_deg))
        # The bottom of the image is on the side of the fingers, on whichever side of them it is.
        turn = RotationMatrix.MakeZRotation(np.arctan2(self.p_MC[0], -self.p_MC[1]))
        return RigidTransform(turn @ tilt, np.array(self.p_MC))
