"""Train a net that finds a part's keypoints: ``python -m experiments.train_keypoints DATASET``.

DATASET is a folder that ``python -m experiments.collect_views`` has filled. The pictures of the
last placements of each posture are kept from training; on them the net is judged. Written to
``--out`` are `PART.onnx`, its card `PART.json`, and a checkpoint. What was interrupted, or reached
the end of its ``--minutes``, goes on when the command is given again, as if it had not stopped.

It needs PyTorch and the package onnx, in an environment of their own: docs/guide/keypoints.md.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from tyro.conf import FlagCreatePairsOff, Positional, arg

from cell.errors import InputError
from cell.products.loading import load_product
from cell.whole_file import whole_file
from experiments.cli.common import BadUsage, check_counts
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder, write_text
from experiments.vision.held_out import judged
from experiments.vision.labelled_views import LabelledView, part_of, read_views
from experiments.vision.symmetry import same_after
from planning.perception.keypoint_card import KeypointCard
from planning.perception.keypoint_net import KeypointNet
from planning.perception.opencv import opencv
from planning.perception.surface import Surface

PRODUCT = "motor_unit"
CHECKPOINT = "checkpoint.pt"
NEEDED = ("torch", "onnx")
KEPT_SHARE = 6  # Of each posture, one placement of so many is kept, but at least one [A].
STRIDE, COARSEST = 4, 16  # Of the network's output, and of what is deepest in it [pixels].
SMALLEST = 64  # Close-up [pixels] [A].


@dataclass(frozen=True)
class Options:
    """Options of the script.

    Attributes:
        dataset: Folder of the pictures.
        out: Folder for net, card and checkpoint.
        steps: Of training, in all.
        minutes: After which this call stops training, wherever it is; none by default.
        batch: Close-ups of a step.
        size: Edge of a close-up [pixels].
        seed: Of everything random.
        quiet: Print nothing but errors.
    """

    dataset: Positional[Annotated[Path, arg(metavar="DATASET")]]
    out: Annotated[Path, arg(metavar="DIR")] = Path("out")
    steps: int = 6000
    minutes: float | None = None
    batch: int = 32
    size: int = 128
    seed: int = 0
    quiet: bool = False


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(Options, args=arguments, description=__doc__, config=(FlagCreatePairsOff,))
    return exit_code("train_keypoints", lambda: run(options))


def run(options: Options) -> int:
    """Train, write net and card, print the scores; return 0.

    Raises:
        InputError: An option is invalid, the dataset cannot be used, the folder holds a training of
            something else, or a package is missing.
    """
    _check(options)
    part = part_of(options.dataset)
    mesh = load_product(PRODUCT).parts[part].mesh
    if turn := same_after(Surface.of(mesh)):
        raise InputError(
            f"Part '{part}' looks the same after a turn by {turn[0]:g} degrees about {turn[1]}: "
            "its keypoints are not where a picture could tell."
        )
    dataset = read_views(options.dataset, mesh)
    learned, kept = split(dataset.views)
    from experiments.vision.training import Training
    from experiments.vision.voting_network import export

    console = Console(quiet=options.quiet, soft_wrap=True)
    card = KeypointCard.of_part(part, mesh, options.size, STRIDE)
    numbers = {name: getattr(options, name) for name in ("steps", "batch", "size", "seed")}
    made_from: dict[str, Any] = {"part": part, "mesh": card.mesh, "data": dataset.about, **numbers}
    training = Training(
        card, learned, dataset.pinhole, options.steps, options.batch, options.seed, made_from
    )
    net = options.out / f"{part}.onnx"
    with output_folder(options.out, CHECKPOINT, net.name, f"{part}.json") as out:
        training.run(out / CHECKPOINT, options.minutes, console.print)
        with whole_file(net) as temporary:
            export(training.network, options.size, temporary)
        about = {
            "data": dataset.about,
            "pictures_learned": len(learned),
            "pictures_kept": len(kept),
            **numbers,
            "steps_done": training.done,
            "weights": sum(values.numel() for values in training.network.parameters()),
            "losses": {"each": "mean over 50 steps: mask, directions", "values": training.history},
        }
        card = replace(card, net=hashlib.sha256(net.read_bytes()).hexdigest(), training=about)
        write_text(out / f"{part}.json", card.text())
        card = judged(KeypointNet.read(net, part, mesh), mesh, kept, dataset.pinhole)
        write_text(out / f"{part}.json", card.text())
    console.print(
        f"{part}: {training.done} of {options.steps} steps; on the pictures kept from it:"
    )
    console.print_json(json.dumps(dict(card.scores)))
    return 0


def split(views: Sequence[LabelledView]) -> tuple[list[LabelledView], list[LabelledView]]:
    """Return the views to learn from, and those to judge by: the last placements of each posture.

    Raises:
        InputError: A posture has one placement only.
    """
    kept: set[int] = set()
    for case in sorted({view.case for view in views}):
        scenes = sorted({view.scene for view in views if view.case == case})
        if len(scenes) < 2:
            raise InputError(f"{case} has one placement only, one more is needed: collect --views.")
        kept |= set(scenes[-max(1, len(scenes) // KEPT_SHARE) :])
    learned = [view for view in views if view.scene not in kept]
    return learned, [view for view in views if view.scene in kept]


def _check(options: Options) -> None:
    """Refuse options that cannot be meant, and an environment that lacks what is needed."""
    check_counts(options, "steps", "batch")
    if options.size < SMALLEST or options.size % COARSEST:
        raise BadUsage(
            f"--size must be a multiple of {COARSEST}, {SMALLEST} or more, not {options.size}."
        )
    if options.minutes is not None and not options.minutes > 0.0:
        raise BadUsage(f"--minutes must be > 0, not {options.minutes}.")
    if options.seed < 0:
        raise BadUsage(f"--seed must be >= 0, not {options.seed}.")
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(
            f"Training needs the Python packages {' and '.join(missing)}, in an environment of "
            "its own: docs/guide/keypoints.md."
        )
    opencv()


if __name__ == "__main__":
    sys.exit(main())
