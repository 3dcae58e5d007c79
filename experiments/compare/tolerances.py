"""How far a value may drift, and why: the one table for ``compare`` and ``regress``.

On one machine the same code, settings and seed give the same bits. The tolerances are for another
machine or library, and for changes of the model that should not change results.
"""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase


@dataclass(frozen=True)
class Tolerance:
    """The allowed drift of a quantity.

    Attributes:
        quantity: Its name with the SI unit; ``*`` in it stands for any text.
        absolute: In the unit of the quantity.
        relative: To the former value; the larger of the two applies.
        reason: For this tolerance.
    """

    quantity: str
    absolute: float
    relative: float
    reason: str

    def allowed(self, before: float) -> float:
        """Return how far a value may be from a former one."""
        return max(self.absolute, self.relative * abs(before))

    def __str__(self) -> str:
        absolute = f"{self.absolute:g}" if self.absolute else ""
        relative = f"{self.relative:.0%}" if self.relative else ""
        return " or ".join(filter(None, (absolute, relative))) or "0"


# What `regress` stores of a case. All numbers are [A], with the reason beside them.
NAMED = (
    Tolerance("success_rate", 0.0, 0.0, "an outcome that flips is a change of behaviour"),
    Tolerance("depth_m", 5e-4, 0.05, "the press stops within a step of its force limit"),
    Tolerance("tilt_rad", 0.01, 0.0, "half a degree is the scatter due to the grasp"),
    Tolerance("release_shift_m", 1e-4, 0.0, "a third of the allowed jump of 0.3 mm"),
    Tolerance("place_normal_peak_N", 0.5, 0.05, "one step of the press, 20 N in 10 mm"),
    Tolerance("displacement_m", 3e-3, 0.05, "half of the 7 mm between limit and push"),
    Tolerance("push_shear_peak_N", 1.0, 0.15, "a peak of stick-slip, averaged over 10 ms"),
    Tolerance("hand_force_peak_N", 2.0, 0.2, "the impact that starts the jig, averaged over 10 ms"),
    Tolerance("part_rotation_rad", 0.05, 0.15, "once the part topples, its final pose is chaotic"),
    Tolerance("holding_N", 0.0, 0.02, "a slow drag: 1e-7 of the vacuum changes it by 1e-7 [M]"),
)
# The first that fits applies.
BY_UNIT = (
    Tolerance("cog_height_m", 1e-6, 0.0, "geometry without simulation: only rounding differs"),
    Tolerance("*_N_m", 0.02, 0.05, "the clutch trips within a step of its torque"),
    Tolerance("*_m_per_s", 2e-3, 0.2, "a tenth of the kick that is allowed"),
    Tolerance("*_m", 3e-4, 0.05, "the jump that a part may make when it is let go"),
    Tolerance("*_rad", 0.01, 0.05, "half a degree is the scatter due to the grasp"),
    Tolerance("*_N", 1.0, 0.15, "a peak of contact, averaged over 10 ms"),
    Tolerance("*_seconds", 0.1, 0.05, "a phase with a guard ends some steps sooner or later"),
    Tolerance("*_share", 0.05, 0.0, "a ratio of two torques that drift themselves"),
    Tolerance("*", 0.01, 0.05, "a number without a unit of which no more is known"),
)
EXACT = Tolerance("", 0.0, 0.0, "a decision or a count: it is the same or it is not")
SUMMARY = "and what chance does to means and rates of the trials, with a confidence of 95 %"


def tolerance_of(quantity: str) -> Tolerance:
    """Return the tolerance of a measured quantity.

    Args:
        quantity: Its name; what stands before the last ``/``, a step or a part, does not matter.
    """
    name = quantity.rpartition("/")[2]
    return next(each for each in (*NAMED, *BY_UNIT) if fnmatchcase(name, each.quantity))
