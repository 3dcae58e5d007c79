"""How good the estimates of many looks are, by the measures that the literature uses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.stats import chi2

from experiments.vision.pose_error import ADD_SHARE, PoseError

DEGREES_OF_FREEDOM = 6
USUAL = float(chi2.median(DEGREES_OF_FREEDOM))  # Of `PoseError.normalised` if it is a right one.


def pose_scores(errors: Sequence[PoseError | None]) -> dict[str, float | None]:
    """Return figures by name: shares of all looks, percentiles of those in which it was found.

    Percentiles of nothing are None.

    Translations are in mm. `normalised_error` is the median of the squared error by its covariance,
    in units of what it would be if that were right.

    Args:
        errors: Of each look, None where the part was not found.
    """
    found = [error for error in errors if error is not None]

    def share(good: Iterator[bool]) -> float:
        return sum(good) / max(len(errors), 1)

    def percentile(name: str, percent: float, scale: float = 1.0) -> float | None:
        values = [scale * getattr(error, name) for error in found]
        return float(np.percentile(values, percent)) if values else None

    measures = {"translation": 1e3, "rotation_deg": 1.0, "yaw_deg": 1.0, "tilt_deg": 1.0,
                "pixels": 1.0}  # fmt: skip
    return {
        "looks": len(errors),
        "found": len(found),
        "within_1_mm_1_deg": share(error.small for error in found),
        "add": share(error.add_share < ADD_SHARE for error in found),
        "add_s": share(error.adds_share < ADD_SHARE for error in found),
        "under_5_px": share(error.pixels < 5.0 for error in found),
        "under_5_cm_5_deg": share(e.translation < 0.05 and e.rotation_deg < 5.0 for e in found),
        **{
            f"{name}_{percent}": percentile(name, percent, scale)
            for name, scale in measures.items()
            for percent in (50, 90)
        },
        "normalised_error": percentile("normalised", 50, 1.0 / USUAL),
    }
