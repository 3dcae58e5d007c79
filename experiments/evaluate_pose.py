"""Accuracy of estimated poses on the jig: ``python -m experiments.evaluate_pose --out DIR``.

Each trial presses a part into the bag with the grasp's random errors, as in the placing experiment,
and lets go. Then the part is looked at several times, each from a few random sides, through a depth
camera with its errors; the estimate starts from the planned pose, off by a random error of a stated
size. The truth serves to judge only. Prints a table and writes it as ``poses.json``, with the boxes
of truth and estimate over an image of each posture.

The camera is placed where it looks from: the arm is not there, and kinematics are exact unless
``--kinematics`` says by how much they are off.
"""

from __future__ import annotations

import sys
import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import tyro
from pydrake.math import RigidTransform, RotationMatrix
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes

from cell.machines.cameras.camera import ABOVE, Picture, cameras_of
from cell.machines.cameras.rendering import NoRendering, rendering_problem
from cell.products.loading import load_product
from cell.whole_file import whole_file
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.paper.cases import case_seed, cases_of
from experiments.paper.rig.stage import Observer
from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import TrialDisturbance, run_trial
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.provenance import versions
from experiments.vision.boxes import ESTIMATE, TRUTH, with_boxes
from experiments.vision.pose_error import ADD_SHARE, PoseError, pose_error, random_error
from planning.perception.registration import Registration, register, views_of
from planning.perception.surface import Surface
from planning.perception.viewpoints import viewpoints

DEGREES_OF_FREEDOM = 6


@dataclass(frozen=True)
class Options:
    """Options of the script.

    Attributes:
        common: Of all commands.
        case: Posture, for example "motor" or "motor/P2"; all by default.
        trials: Placements of each posture.
        looks: At each part that has been placed.
        views: Of each look.
        start: Error of the pose that an estimate starts from [m].
        start_deg: The same about a random axis [deg].
        kinematics: Standard deviation of where the camera is believed to be, per axis [m].
        kinematics_deg: The same about each axis [deg].
    """

    common: OmitArgPrefixes[Common] = field(default_factory=Common)
    case: str | None = None
    trials: int = 4
    looks: int = 5
    views: int = 3
    start: float = 5e-3
    start_deg: float = 15.0
    kinematics: float = 0.0
    kinematics_deg: float = 0.0


@dataclass(frozen=True)
class Look:
    """One estimate and its error; both None if the views showed too little."""

    cpu_seconds: float
    error: PoseError | None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(Options, args=arguments, description=__doc__, config=(FlagCreatePairsOff,))
    return exit_code("evaluate_pose", lambda: run(options))


def run(options: Options) -> int:
    """Evaluate the postures, write ``poses.json`` and the pictures, print the table; return 0.

    Raises:
        InputError: An option is invalid.
        NoRendering: This machine cannot render.
    """
    config, cases = options.common.load_config(), cases_of("place", options.case)
    check_counts(options, "trials", "looks", "views")
    if reason := rendering_problem():
        raise NoRendering(f"pose estimation needs pictures: {reason}")
    product, rows = load_product("motor_unit"), {}
    with output_folder(Path(options.common.out)) as out:
        for case in cases:
            eye = _Eye(options, out, case.label)
            bench = RigBench.build(config, product, case.posture)
            for number in range(options.trials):
                rng = case_seed(options.common.seed, case.label, number)
                run_trial(bench.begin(TrialDisturbance.draw(config, rng)), None, eye.see)
            rows[case.label] = _summary(eye.looks)
        report = {
            "seed": options.common.seed,
            "options": {key: value for key, value in vars(options).items() if key != "common"},
            "cases": rows,
            "versions": versions(),
        }
        write_json(out / "poses.json", report)
    Console(quiet=options.common.quiet).print(_table(rows))
    return 0


@dataclass
class _Eye:
    """Looks at parts of one posture, and keeps how wrong the estimates are."""

    options: Options
    out: Path
    label: str
    looks: list[Look] = field(default_factory=list)

    def see(self, event: str, observer: Observer) -> None:
        """Look at a part that has been placed."""
        if event != "placed":
            return
        stage, X_WTrue, options = observer.stage, observer.X_WP, self.options
        cameras = cameras_of(stage.plant, stage.scene_graph, observer.X_WJ, stage.config.camera)
        surface = Surface.of(stage.part.part.mesh)
        stream = zlib.crc32(self.label.encode())
        rng = np.random.default_rng([options.common.seed, stream, len(self.looks)])
        for _ in range(options.looks):
            first = not self.looks
            pictures = [
                cameras[ABOVE].placed(X_WC).take(observer.root, rng, color=first)
                for X_WC in viewpoints(X_WTrue @ surface.centre, options.views, rng)
            ]
            believed = [_misplaced(picture, options, rng) for picture in pictures]
            X_WStart = X_WTrue @ random_error(options.start, options.start_deg, rng)
            started = time.process_time()
            views = views_of(believed, surface, X_WStart, rng)
            estimate = register(surface, views, X_WStart)
            seconds = time.process_time() - started
            error = _judged(surface, estimate, X_WTrue, pictures[0])
            self.looks.append(Look(seconds, error))
            if estimate is not None and first:
                boxes = {TRUTH: X_WTrue, ESTIMATE: estimate.X_WP}
                image = with_boxes(pictures[0], surface, boxes)
                with whole_file(self.out / f"{self.label.replace('/', '_')}.png") as file:
                    file.write_bytes(image)


def _judged(
    surface: Surface, estimate: Registration | None, X_WTrue: RigidTransform, picture: Picture
) -> PoseError | None:
    if estimate is None:
        return None
    return pose_error(
        surface, estimate.X_WP, X_WTrue, estimate.covariance, picture.pinhole, picture.X_WC
    )


def _misplaced(picture: Picture, options: Options, rng: np.random.Generator) -> Picture:
    """Return a picture that is believed to be taken from a little elsewhere."""
    offset = rng.normal(scale=options.kinematics, size=3)
    turn = rng.normal(scale=np.deg2rad(options.kinematics_deg), size=3)
    X_CBelieved = RigidTransform(RotationMatrix(Rotation.from_rotvec(turn).as_matrix()), offset)
    X_WC = picture.X_WC @ X_CBelieved
    return replace(picture, X_WC=X_WC)


def _summary(looks: Sequence[Look]) -> dict[str, float]:
    """Return the figures of one posture."""
    errors = [look.error for look in looks if look.error is not None]

    def share(good: Iterator[bool]) -> float:
        return sum(good) / max(len(looks), 1)

    def percentiles(name: str, scale: float) -> dict[str, float]:
        values = [scale * getattr(error, name) for error in errors] or [np.nan]
        return {f"{name}_{p}": float(np.percentile(values, p)) for p in (50, 90)}

    normalised = [error.normalised / DEGREES_OF_FREEDOM for error in errors] or [np.nan]
    return {
        "looks": len(looks),
        "found": len(errors),
        "within_1_mm_1_deg": share(error.small for error in errors),
        "add": share(error.add_share < ADD_SHARE for error in errors),
        "under_5_px": share(error.pixels < 5.0 for error in errors),
        "under_5_cm_5_deg": share(e.translation < 0.05 and e.rotation_deg < 5.0 for e in errors),
        **percentiles("translation", 1e3),
        **percentiles("yaw_deg", 1.0),
        **percentiles("tilt_deg", 1.0),
        "normalised_error": float(np.median(normalised)),
        "cpu_seconds": float(np.mean([look.cpu_seconds for look in looks] or [np.nan])),
    }


def _table(rows: dict[str, dict[str, float]]) -> Table:
    title = "Poses estimated on the jig; small: 1 mm, 1 deg; errors at 50/90 %"
    table = Table(title=title, title_justify="left")
    headings = ("posture", "looks", "small", "ADD", "mm", "yaw deg", "tilt deg", "CPU s")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "posture" else "right")
    for label, row in rows.items():
        pairs = [f"{row[f'{n}_50']:.2f}/{row[f'{n}_90']:.2f}"
                 for n in ("translation", "yaw_deg", "tilt_deg")]  # fmt: skip
        shares = [f"{100 * row[name]:.0f} %" for name in ("within_1_mm_1_deg", "add")]
        table.add_row(label, f"{row['looks']:.0f}", *shares, *pairs, f"{row['cpu_seconds']:.2f}")
    return table


if __name__ == "__main__":
    sys.exit(main())
