"""Find out where the camera is on the hand: ``python -m experiments.calibrate_hand_eye --out DIR``.

The hand carries the camera round the board of markers. The mount is believed to be where it is but
for an error of a stated size, the board is not known at all, and the arm's joint angles say where
the hand is with an error of a stated size in every view. From the images both mount and board are
found; the script prints how far off they are from the truth, and writes ``hand_eye.json``.

Views are planned with the true mount: an error of some millimetres does not matter to them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro
from pydrake.math import RigidTransform
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes

from cell.errors import RunFailure
from cell.machines.cameras.marker_board import X_JD
from cell.machines.cameras.rendering import NoRendering, rendering_problem
from cell.products.loading import load_product
from experiments.cli.common import BadUsage, Common
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.provenance import versions
from experiments.vision.labelling import marked
from experiments.vision.lighting import random_lighting
from experiments.vision.pose_error import apart, random_error
from experiments.vision.studio import Studio
from planning.perception.hand_eye_calibration import FEWEST, BoardView, calibrate_hand_eye
from planning.perception.marker_pose import moved

PRODUCT = "motor_unit"
MISSED = 3  # So many views without the board for each one that is wanted, and it is given up [A].


@dataclass(frozen=True)
class Options:
    """Options of the script.

    Attributes:
        common: Of all commands.
        views: Of the board.
        start: By how much the believed mount is off [m].
        start_deg: The same about a random axis [deg].
        kinematics: Standard deviation of where the hand is believed to be, per axis [m].
        kinematics_deg: The same about each axis [deg].
    """

    common: OmitArgPrefixes[Common] = field(default_factory=Common)
    views: int = 20
    start: float = 3e-3
    start_deg: float = 2.0
    kinematics: float = 1e-4
    kinematics_deg: float = 0.05


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(Options, args=arguments, description=__doc__, config=(FlagCreatePairsOff,))
    return exit_code("calibrate_hand_eye", lambda: run(options))


def run(options: Options) -> int:
    """Calibrate, write ``hand_eye.json``, print the table; return 0.

    Raises:
        InputError: An option is invalid.
        NoRendering: This machine cannot render.
        RunFailure: The board is hardly ever in sight.
    """
    config = options.common.load_config()
    if options.views < FEWEST:
        raise BadUsage(f"--views must be at least {FEWEST}, not {options.views}.")
    for name in ("start", "start_deg", "kinematics", "kinematics_deg"):
        if not 0.0 <= getattr(options, name) < np.inf:
            shown = name.replace("_", "-")
            raise BadUsage(f"--{shown} must be at least 0, not {getattr(options, name)}.")
    if reason := rendering_problem():
        raise NoRendering(f"calibration needs pictures: {reason}")
    rng = np.random.default_rng(options.common.seed)
    with output_folder(Path(options.common.out), "hand_eye.json") as out:
        studio = Studio(config, load_product(PRODUCT))
        X_MC, X_WD = studio.config.camera.X_MC, studio.X_WJ @ X_JD
        X_MCStart = X_MC @ random_error(options.start, options.start_deg, rng)
        views = _views(studio, options, rng)
        found = calibrate_hand_eye(views, X_MCStart)
        sigma = np.sqrt(np.diag(found.covariance))
        rows = {
            "mount, believed": (*apart(X_MCStart, X_MC), np.nan, np.nan),
            "mount, found": (*apart(found.X_MC, X_MC), *_sizes(sigma[:6])),
            "board, found": (*apart(found.X_WD, X_WD), *_sizes(sigma[6:])),
        }
        names = ("offset_mm", "turn_deg", "sigma_mm", "sigma_deg")
        report = {
            "seed": options.common.seed,
            "options": {key: value for key, value in vars(options).items() if key != "common"},
            "errors": {
                label: {n: v for n, v in zip(names, row, strict=True) if np.isfinite(v)}
                for label, row in rows.items()
            },
            "X_MC": found.X_MC.GetAsMatrix4(),
            "kinematics_off_mm": 1e3 * found.offset,
            "kinematics_off_deg": found.turn_deg,
            "versions": versions(),
        }
        write_json(out / "hand_eye.json", report)
    table = Table(title="Errors against the truth, and their estimated standard deviations")
    for heading in ("", "mm", "deg", "sigma mm", "sigma deg"):
        table.add_column(heading, justify="right" if heading else "left")
    for label, row in rows.items():
        table.add_row(label, *("" if np.isnan(value) else f"{value:.3f}" for value in row))
    Console(quiet=options.common.quiet).print(table)
    return 0


def _views(studio: Studio, options: Options, rng: np.random.Generator) -> list[BoardView]:
    """Return views of the board under one lighting, with what kinematics say about the hand."""
    views, taken = [], 0
    sides = studio.views(rng)
    with studio.open_shutter(), studio.lit(random_lighting(rng)) as query:
        while len(views) < options.views:
            if taken == MISSED * options.views:
                raise RunFailure(
                    f"The board of markers is in sight in {len(views)} of {taken} views."
                )
            next(sides)
            taken += 1
            one = marked(studio.take(query, rng), studio.camera.pinhole)
            if one is not None:
                turn = rng.normal(scale=np.deg2rad(options.kinematics_deg), size=3)
                offset = rng.normal(scale=options.kinematics, size=3)
                X_WM: RigidTransform = moved(one.shot.X_WM, np.r_[turn, offset])
                views.append(BoardView(X_WM, one.board.X_CD))
    return views


def _sizes(sigma: np.ndarray) -> tuple[float, float]:
    """Return the standard deviations (6,) of a pose as a distance [mm] and an angle [deg]."""
    return float(1e3 * np.linalg.norm(sigma[3:])), float(np.rad2deg(np.linalg.norm(sigma[:3])))


if __name__ == "__main__":
    sys.exit(main())
