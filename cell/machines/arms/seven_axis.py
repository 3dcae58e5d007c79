"""Arms with seven joints: the elbow can swing while the flange stands still.

Dimensions, masses, centres of mass and inertias of the LBR iiwa 14 R820 [R IFL-CAMP/iiwa_stack,
iiwa_description/urdf/iiwa14.xacro, commit 052aa68d]; its joints' range and speed [R
lbr-stack/lbr_fri_ros2_stack, lbr_description/urdf/iiwa14/joint_limits.yaml, commit 769ae8e7] and
torque [R KUKA, brochure "Sensitive robotics LBR iiwa", p. 30]. Shoulder, elbow, wrist and flange
are 0.360, 0.420, 0.400 and 0.126 m apart. With all joints at zero the arm points straight up. There
is no closed form here: the kinematics are those of any chain.
"""

from __future__ import annotations

import math

from cell.machines.arms.base import ArmModel, Link

QUARTER, HALF = math.pi / 2, math.pi
# Range either way [deg], speed [deg/s], torque [N m] of each joint.
JOINTS = (
    (170.0, 85.0, 320.0),
    (120.0, 85.0, 320.0),
    (170.0, 100.0, 176.0),
    (120.0, 75.0, 176.0),
    (170.0, 130.0, 110.0),
    (120.0, 135.0, 40.0),
    (175.0, 135.0, 40.0),
)
# Origin in the link before [m], turn there [rad], mass [kg], centre of mass [m], moments [kg m2].
LINKS = (
    ((0, 0, 0.1575), (0, 0, 0), 4.0, (0, -0.03, 0.12), (0.1, 0.09, 0.02)),
    ((0, 0, 0.2025), (QUARTER, 0, HALF), 4.0, (0.0003, 0.059, 0.042), (0.05, 0.018, 0.044)),
    ((0, 0.2045, 0), (QUARTER, 0, HALF), 3.0, (0, 0.03, 0.13), (0.08, 0.075, 0.01)),
    ((0, 0, 0.2155), (QUARTER, 0, 0), 2.7, (0, 0.067, 0.034), (0.03, 0.01, 0.029)),
    ((0, 0.1845, 0), (-QUARTER, HALF, 0), 1.7, (0.0001, 0.021, 0.076), (0.02, 0.018, 0.005)),
    ((0, 0, 0.2155), (QUARTER, 0, 0), 1.8, (0, 0.0006, 0.0004), (0.005, 0.0036, 0.0047)),
    ((0, 0.081, 0), (-QUARTER, HALF, 0), 0.3, (0, 0, 0.02), (0.001, 0.001, 0.001)),
)

IIWA14 = ArmModel(
    name="iiwa14",
    links=tuple(
        Link(
            f"link_{number}",
            f"joint_{number}",
            *geometry,
            lower=-math.radians(range_deg),
            upper=math.radians(range_deg),
            speed=math.radians(speed_deg),
            effort=effort,
        )
        for number, (geometry, (range_deg, speed_deg, effort)) in enumerate(
            zip(LINKS, JOINTS, strict=True), start=1
        )
    ),
    base_mass=5.0,
    payload=14.0,  # [R] IFL-CAMP/iiwa_stack, description of the repository.
    flange_z=0.045,
    # As stiff as the six-axis arms [A]; about critical with the arm stretched [D].
    stiffness=(2e4, 2e4, 2e4, 2e4, 5e3, 5e3, 5e3),
    damping=(500.0, 500.0, 300.0, 300.0, 60.0, 60.0, 60.0),
    # Upper arm leaning back, forearm level, tool down [A].
    home_deg={
        "gripper": (0.0, -15.0, 0.0, -105.0, 0.0, 90.0, 0.0),
        "driver": (-120.0, -15.0, 0.0, -105.0, 0.0, 90.0, 0.0),
    },
)
