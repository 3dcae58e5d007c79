"""Settings of what is done in the cell, and of the errors that it is done with."""

from __future__ import annotations

from dataclasses import dataclass

from cell.fixtures.jig_dimensions import BEAD_MASS, JIG_MASS
from cell.setting import setting


@dataclass(frozen=True)
class PlacementConfig:
    """Pressing a part into the soft bed."""

    press_force: float = setting(
        20.0, "N", "Downward force that ends the pressing.",
        "[A] 20, plausible 15-30.",
        above=0.0, at_most=100.0,
    )  # fmt: skip


@dataclass(frozen=True)
class PushConfig:
    """The paper's push experiment: one set of numbers for all cases and both parts."""

    jig_mass: float = setting(
        JIG_MASS, "kg", "Mass of base and beads; more than the beads alone.",
        "[A] Not in the paper; plausible 1-3.",
        above=BEAD_MASS, at_most=20.0,
    )  # fmt: skip
    base_friction: float = setting(
        0.4, "", "Friction of the base on the force plate.",
        "[A] 0.4, plausible 0.3-0.6.",
        above=0.0, at_most=2.0,
    )  # fmt: skip
    base_stiffness: float = setting(
        3e6, "N/m", "Of the dry joint of force plate and base, one of the paper's size.",
        "[R] Load / (0.5 rms unevenness) (Persson 2007): 15 N on 10 um; plausible 1e6-1e7. "
        "1 ms resolves 3e6, not 1e7 [M].",
        above=0.0, at_most=1e8,
    )  # fmt: skip
    speed: float = setting(
        0.28, "m/s", "Speed of the hand at the end of the push.",
        "[D] Coasting by 8 mm past 70 [S] asks for 0.22-0.29.",
        above=0.0, at_most=1.0,
    )  # fmt: skip
    acceleration: float = setting(
        1.0, "m/s2", "Acceleration of the hand from rest.",
        "[A] Up to speed in 39 mm of the 70.",
        above=0.0, at_most=100.0,
    )  # fmt: skip
    stroke: float = setting(
        0.070, "m", "Length of the straight push.",
        "[S] 70 mm.",
        above=0.0, at_most=0.15,
    )  # fmt: skip
    start_gap: float = setting(
        2e-3, "m", "Gap between hand and part at the start.",
        "[A] 2 mm, plausible 0.5-5 mm.",
        at_least=0.0, at_most=0.02,
    )  # fmt: skip
    fingertip_height: float = setting(
        2e-3, "m", "Height of the fingers' lowest point above the bed beside the pushed face.",
        "[D] The lying plate stands out by 2 to 4 mm, the membrane is to be cleared.",
        at_least=0.0, at_most=0.1,
    )  # fmt: skip
    palm_height: float = setting(
        46.5e-3, "m", "Palm above the fingertips of the hand that pushes on the rig.",
        "[R] Hand-E, data sheet, with its own fingers; those of the model are longer.",
        at_least=0.01, at_most=0.2,
    )  # fmt: skip
    grasp_position_sigma: float = setting(
        5e-4, "m", "Standard deviation of the part's position in the grasp, per axis.",
        "[A] Own choice.",
        at_least=0.0, at_most=0.02,
    )  # fmt: skip
    grasp_angle_sigma_deg: float = setting(
        1.0, "deg", "Standard deviation of the part's rotation in the grasp, per axis.",
        "[A] Own choice.",
        at_least=0.0, at_most=30.0,
    )  # fmt: skip
    jig_position_sigma: float = setting(
        1e-3, "m", "Standard deviation of the jig's place, along x and y.",
        "[A] Own choice.",
        at_least=0.0, at_most=0.05,
    )  # fmt: skip


@dataclass(frozen=True)
class MotionConfig:
    """Free motion of the arms."""

    velocity_scale: float = setting(
        0.9, "", "Share of the joint speed limits.",
        "[A] The rest is for the feedback. Slip in the jaws grows with it [M].",
        above=0.0, at_most=1.0,
    )  # fmt: skip
    acceleration_limit: float = setting(
        12.0, "rad/s2", "Acceleration limit of every joint.",
        "[A] Own choice; what holds most motions back is the wrist force.",
        above=0.0, at_most=100.0,
    )  # fmt: skip
    wrist_force: float = setting(
        2.5, "N", "Largest force that accelerates tool and payload, along each axis of W.",
        "[A] In all at most 4.3 N, less than half of what insertions and thrusts take.",
        above=0.0, at_most=1000.0,
    )  # fmt: skip
    ramp_time: float = setting(
        0.04, "s", "Time in which an acceleration of an arm rises or falls.",
        "[M] What swings in arm and drives comes to rest within 0.03 s.",
        at_least=1e-3, at_most=1.0,
    )  # fmt: skip
    tool_speed: float = setting(
        0.25, "m/s", "Speed of a tool on straight stretches beside parts.",
        "[R] ISO 10218-1: reduced speed, at most 250 mm/s.",
        above=0.0, at_most=2.0,
    )  # fmt: skip
    arm_clearance: float = setting(
        0.01, "m", "Distance kept between the arms.",
        "[A] Own choice.",
        at_least=0.0, at_most=0.2,
    )  # fmt: skip
    obstacle_clearance: float = setting(
        0.005, "m", "Distance kept between robot and surroundings.",
        "[A] Own choice.",
        at_least=0.0, at_most=0.1,
    )  # fmt: skip
    max_iterations: int = setting(
        20000, "", "Iterations of the sampling planner, per path.",
        "[A] Own choice; iterations and not seconds, so that runs repeat.",
        at_least=1, at_most=10_000_000,
    )  # fmt: skip


@dataclass(frozen=True)
class InsertionConfig:
    """Compliant insertion of a shaft or boss into its hole."""

    force_limit: float = setting(
        10.0, "N", "Largest downward force.",
        "[M] Above it a sharp edge is squeezed in.",
        above=0.0, at_most=30.0,
    )  # fmt: skip
    lateral_stiffness: float = setting(
        4000.0, "N/m", "Lateral stiffness of the compliance centred on the hole.",
        "[M] 3000 to 6000 work.",
        above=0.0, at_most=1e5,
    )  # fmt: skip
    rotational_stiffness: float = setting(
        5.0, "N m/rad", "Rotational stiffness of the compliance centred on the hole.",
        "[M] Stiffer leaves the plate tilted on the motor.",
        above=0.0, at_most=1e3,
    )  # fmt: skip
    speed: float = setting(
        0.012, "m/s", "Speed of the descent.",
        "[A] Own choice.",
        above=0.0, at_most=0.1,
    )  # fmt: skip
    landing_speed: float = setting(
        3e-3, "m/s", "Speed of the descent around the seat, which is stiff.",
        "[M] 20 mm/s strike the seat with 40 N.",
        above=0.0, at_most=0.1,
    )  # fmt: skip
    search_force: float = setting(
        3.0, "N", "Downward force during the spiral.",
        "[M] In simulation.",
        above=0.0, at_most=30.0,
    )  # fmt: skip
    search_pitch: float = setting(
        1.5e-4, "m", "Distance between two turns of the spiral.",
        "[M] About twice the radial clearance.",
        above=0.0, at_most=0.01,
    )  # fmt: skip
    search_speed: float = setting(
        5e-3, "m/s", "Speed along the spiral.",
        "[A] Own choice.",
        above=0.0, at_most=0.1,
    )  # fmt: skip
    search_radius: float = setting(
        1.5e-3, "m", "Radius at which the search gives up.",
        "[A] Own choice.",
        above=0.0, at_most=0.02,
    )  # fmt: skip


@dataclass(frozen=True)
class DisturbanceConfig:
    """Deviations from the nominal layout, drawn once per run from the seed."""

    tray_position_sigma: float = setting(
        5e-4, "m", "Standard deviation of the tray's place along x and y.",
        "[A] Set down by hand.",
        at_least=0.0, at_most=0.05,
    )  # fmt: skip
    tray_yaw_sigma_deg: float = setting(
        1.0, "deg", "Standard deviation of the tray's rotation about the vertical.",
        "[A] Set down by hand.",
        at_least=0.0, at_most=30.0,
    )  # fmt: skip


TRUTH, CAMERA, BLIND = "truth", "camera", "blind"  # Sources of `SensorConfig`.


@dataclass(frozen=True)
class SensorConfig:
    """How it is sensed where parts are."""

    source: str = setting(
        TRUTH, "", "With what: truth (and the noise below), camera (depth images from the hand), "
        "or blind (nothing is sensed: the tray is where the layout has it).",
        "[A] The truth by default.",
    )  # fmt: skip
    position_noise: float = setting(
        0.0, "m", "Standard deviation of a sensed position, per axis.",
        "[A] The true pose by default.",
        at_least=0.0, at_most=0.05,
    )  # fmt: skip
    angle_noise_deg: float = setting(
        0.0, "deg", "Standard deviation of a sensed rotation, about each axis.",
        "[A] The true pose by default.",
        at_least=0.0, at_most=30.0,
    )  # fmt: skip
