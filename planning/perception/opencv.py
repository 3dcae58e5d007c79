"""OpenCV, an optional package: only who runs nets for keypoints needs it."""

from __future__ import annotations

import importlib.util
from types import ModuleType

from cell.errors import InputError

PACKAGE, OLDEST = "opencv-python-headless", 5  # Version: older ones read nets differently.


def opencv() -> ModuleType:
    """Return the module `cv2`.

    Raises:
        InputError: It is not installed, or too old.
    """
    if importlib.util.find_spec("cv2") is None:
        raise InputError(f"Keypoints need the Python package '{PACKAGE}': pip install {PACKAGE}.")
    import cv2

    if int(cv2.__version__.split(".")[0]) < OLDEST:
        raise InputError(
            f"Keypoints need '{PACKAGE}' {OLDEST} or newer, not {cv2.__version__}: "
            f"pip install --upgrade {PACKAGE}."
        )
    return cv2
