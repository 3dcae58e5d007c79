"""Accuracy of estimated poses on the jig: ``python -m experiments.evaluate_pose --out DIR``.

Each trial presses a part into the bag with the grasp's random errors, as in the placing experiment,
and lets go. Then the part is looked at several times, each from a few random sides, through a depth
camera with its errors. ``--estimator`` names the ways to tell its pose from that, one or several:

- ``depth`` registers all views from the planned pose, off by a random error of a stated size.
- ``keypoints`` takes the first view's colour image, and knows where the middle of the bag is.
- ``both`` finishes that by the depth of all views.

The truth serves to judge only. Prints a table and writes it as ``poses.json``, with the boxes
of truth and estimate over an image of each posture.

The camera is placed where it looks from: the arm is not there, and kinematics are exact unless
``--kinematics`` says by how much they are off.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.errors import UnknownName
from cell.machines.cameras.rendering import NoRendering, rendering_problem
from cell.products.loading import load_product
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.paper.cases import case_seed, cases_of
from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import TrialDisturbance, run_trial
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.provenance import versions
from experiments.vision.looks import BOTH, ESTIMATORS, KEYPOINTS, LIGHTINGS, Eye, Looking
from planning.perception.keypoint_card import NETS, net_file
from planning.perception.keypoint_net import KeypointNet


@dataclass(frozen=True)
class Options:
    """Options of the script.

    Attributes:
        common: Of all commands.
        looking: How parts are looked at.
        case: Posture, for example "motor" or "motor/P2"; all by default.
        trials: Placements of each posture.
        nets: Folder of the nets for keypoints.
    """

    common: OmitArgPrefixes[Common] = field(default_factory=Common)
    looking: OmitArgPrefixes[Looking] = field(default_factory=Looking)
    case: str | None = None
    trials: int = 4
    nets: Annotated[Path, arg(metavar="DIR")] = NETS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(Options, args=arguments, description=__doc__, config=(FlagCreatePairsOff,))
    return exit_code("evaluate_pose", lambda: run(options))


def run(options: Options) -> int:
    """Evaluate the postures, write ``poses.json`` and the pictures, print the table; return 0.

    Raises:
        InputError: An option is invalid, or a net is missing.
        NoRendering: This machine cannot render.
    """
    config, cases = options.common.load_config(), cases_of("place", options.case)
    looking = options.looking
    check_counts(options, "trials")
    check_counts(looking, "looks", "views")
    for name in looking.estimator:
        if name not in ESTIMATORS:
            raise UnknownName("estimator", name, ESTIMATORS)
    if looking.lighting not in LIGHTINGS:
        raise UnknownName("lighting", looking.lighting, LIGHTINGS)
    product, rows = load_product("motor_unit"), {}
    parts = {case.posture.part: product.parts[case.posture.part].mesh for case in cases}
    nets: dict[str, KeypointNet] = {}
    if {KEYPOINTS, BOTH} & set(looking.estimator):
        nets = {n: KeypointNet.read(net_file(n, options.nets), n, parts[n]) for n in sorted(parts)}
    if reason := rendering_problem():
        raise NoRendering(f"pose estimation needs pictures: {reason}")
    with output_folder(Path(options.common.out)) as out:
        for case in cases:
            part = case.posture.part
            eye = Eye(looking, out, case.label, options.common.seed, parts[part], nets.get(part))
            bench = RigBench.build(config, product, case.posture)
            for number in range(options.trials):
                rng = case_seed(options.common.seed, case.label, number)
                run_trial(bench.begin(TrialDisturbance.draw(config, rng)), None, eye.see)
            rows[case.label] = eye.scores()
        report = {
            "seed": options.common.seed,
            "options": {"case": options.case, "trials": options.trials, **vars(looking)},
            "nets": {name: net.card.net for name, net in nets.items()},
            "cases": rows,
            "versions": versions(),
        }
        write_json(out / "poses.json", report)
    for estimator in looking.estimator:
        Console(quiet=options.common.quiet).print(_table(estimator, rows))
    return 0


def _table(estimator: str, rows: Mapping[str, Mapping[str, Mapping[str, float | None]]]) -> Table:
    title = (
        f"Poses on the jig by {estimator}. Shares of looks in %: found, within 1 mm and 1 deg, "
        "ADD, ADD-S, 5 px, 5 cm and 5 deg. Errors at 50/90 %."
    )
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    headings = ("posture", "n", "found", "1 mm", "ADD", "-S", "5 px", "5 cm", "mm", "yaw deg",
                "tilt deg", "CPU s")  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "posture" else "right")
    shares = ("within_1_mm_1_deg", "add", "add_s", "under_5_px", "under_5_cm_5_deg")
    for label, by_estimator in rows.items():
        row = by_estimator[estimator]
        looks, found = row["looks"] or 0, row["found"] or 0
        percents = [found / max(looks, 1), *(row[name] or 0.0 for name in shares)]
        pairs = ["/".join(_short(row[f"{name}_{p}"]) for p in (50, 90))
                 for name in ("translation", "yaw_deg", "tilt_deg")]  # fmt: skip
        table.add_row(
            label, str(looks), *(f"{100 * share:.0f}" for share in percents), *pairs,
            _short(row["cpu_seconds"]),
        )  # fmt: skip
    return table


def _short(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


if __name__ == "__main__":
    sys.exit(main())
