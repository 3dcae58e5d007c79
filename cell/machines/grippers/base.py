"""What a parallel-jaw gripper is before it stands in a cell: travel, forces, masses, fingertips.

Two fingers move apart along x of the tool; the opening is the distance between the tip pads. The
frames of every gripper's model are ``mount`` (meets the arm's flange, +z out of it) and one per
jaw: ``tip``, ``wide`` and ``nose``, midway between that jaw's faces, with x the closing direction,
y lateral and z the approach direction. Products name the jaw of a grasp, not the gripper.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Size = tuple[float, float, float]


@dataclass(frozen=True)
class Fingertips:
    """Three pairs of jaws on one pair of fingers; sizes are (x, y, z) [m], all [A].

    ``tip`` are the main pads; ``wide`` are recessed wings that hold what is 24 mm wider than the
    opening; ``nose`` are narrow ends that pick a bolt by its head. The pads are thin blades so that
    the tip can pick a bolt next to a motor's shaft: 10 mm away from the bolt's axis, of which the
    shaft takes 3 mm and half the bolt's head 2.75 mm.

    Attributes:
        pad: Size of a main pad.
        wing: Size of a wing.
        wing_offset: The wing's face stands back this far behind the pad's face.
        wing_y: Lateral place of the wings.
        nose: Size of a nose.
        nose_start: Where the nose begins on z, from the frame ``tip``.
        nose_z: Where the frame ``nose`` is on z, from the frame ``tip``.
    """

    pad: Size = (0.003, 0.016, 0.020)
    wing: Size = (0.004, 0.016, 0.020)
    wing_offset: float = 0.012
    wing_y: float = 0.022
    nose: Size = (0.002, 0.003, 0.014)
    nose_start: float = 0.010
    nose_z: float = 0.0225


@dataclass(frozen=True)
class GripperModel:
    """One type of parallel-jaw gripper.

    Attributes:
        name: By which a configuration asks for it.
        travel: Of each finger [m].
        speed: Largest of each finger [m/s].
        effort: Largest force of the drive, which both fingers share [N].
        least_effort: Smallest force that the drive can be set to [N].
        palm_length: From the mount to the palm's front face [m].
        palm_mass: With coupler, without fingers [kg].
        finger_mass: Of one finger without fingertip [kg].
        finger_damping: Friction of a finger's slide [N s/m].
        tips: The fingertips.
        tip_distance: From the palm's front face to the frame ``tip`` [m].
        stiffness, damping: Position loop of the drive [N/m], [N s/m]: stiff against the grip force,
            soft against a width error: 0.5 mm of it changes the force by 2.5 N [A].
    """

    name: str
    travel: float
    speed: float
    effort: float
    least_effort: float
    palm_length: float
    palm_mass: float
    finger_mass: float
    finger_damping: float = 5.0  # [A]
    tips: Fingertips = Fingertips()
    tip_distance: float = 0.065
    stiffness: float = 2e4
    damping: float = 200.0

    mount_frame = "mount"
    drive_joint = "finger_left_joint"
    follower_joint = "finger_right_joint"

    @property
    def sdf(self) -> str:
        """Name of its model in models/sdf, or the URL of one elsewhere."""
        return self.name

    @property
    def stroke(self) -> float:
        """Largest opening of the tip pads [m]."""
        return 2.0 * self.travel

    @property
    def setback(self) -> Mapping[str, float]:
        """By jaw, how far its faces stand back behind the tip pads, both sides together [m]."""
        return {"tip": 0.0, "nose": 0.0, "wide": 2.0 * self.tips.wing_offset}

    @property
    def tip_z(self) -> float:
        """Distance of the frame ``tip`` from the mount [m]."""
        return self.palm_length + self.tip_distance
