"""Collect labelled pictures of a part: ``python -m experiments.collect_views motor --views 300``.

As the paper does it: the arm carries its camera round the jig, a board of printed markers tells
where the camera is, and what is learned from are the pictures with the markers painted over. In
every scene the rig presses the part in anew, in one posture after another; the pictures of a scene
differ in view and lighting. They are written to ``--out`` as a BOP dataset; labels and masks come
from the markers and the depth alone. How wrong they are against the truth stands in
``collection.json``. A collection that was interrupted goes on when the command is given again, and
one that is complete grows when more ``--views`` are asked for.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro
from pydrake.math import RigidTransform
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from cell.configuration.config import CellConfig
from cell.errors import InputError, RunFailure
from cell.fixtures import fixture_class
from cell.machines.cameras.rendering import NoRendering, rendering_problem
from cell.products.loading import load_product
from cell.products.product import Product
from cell.simulation.phase import PhaseFailed
from cell.whole_file import whole_file
from experiments.cli.common import BadUsage, Common, check_counts
from experiments.cli.ending import exit_code
from experiments.paper.cases import Case, case_seed, cases_of
from experiments.paper.rig_hand import RigBench
from experiments.reporting.output import output_folder, write_json, write_text
from experiments.reporting.provenance import finite, versions
from experiments.vision.bop import SPLIT, box_centre, scene_folder, write_head, write_scene
from experiments.vision.collecting import LabelError, Scene, Unlabelled, collect_scene, summary
from experiments.vision.placing import Placed, press_in
from experiments.vision.studio import Studio

PRODUCT = "motor_unit"
RECORD = "collection.json"
ATTEMPTS = 3  # At a scene whose part falls off or is not found.
INFO = """# Pictures of '{part}' on a soft jig

Rendered in a digital twin: a camera like a RealSense D435 on the hand of an arm, {views} pictures.

- One scene is one placement of the part; its pictures differ in view and lighting.
- Object {number} is '{part}'. Its model's origin is the centre of its bounding box, which in the
  part's CAD frame is at ({x:.4f}, {y:.4f}, {z:.4f}) mm; the axes are those of that frame.
- The world (`cam_R_w2c`, `cam_t_w2c`) is the board of markers around the jig.
- `rgb` has the markers painted over. `depth` has the errors of a stereo camera.
- Labels come from markers and depth, as with a real camera, not from the truth; so do the masks.
  `mask_visib` is where the depth is not more than 3 mm nearer than the model.
- `collection.json` says how wrong labels and masks are against the truth, picture by picture.
"""


@dataclass(frozen=True)
class Options:
    """Options of the script.

    Attributes:
        part: Of which pictures are taken, or one posture of it, for example "motor/P2".
        common: Of all commands.
        views: How many pictures.
        views_per_scene: Of them after each placement.
    """

    part: Positional[Annotated[str, arg(metavar="PART")]]
    common: OmitArgPrefixes[Common] = field(default_factory=Common)
    views: int = 300
    views_per_scene: int = 25


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(Options, args=arguments, description=__doc__, config=(FlagCreatePairsOff,))
    return exit_code("collect_views", lambda: run(options))


def run(options: Options) -> int:
    """Collect what is missing, write the dataset, print the table; return 0.

    Raises:
        InputError: An option is invalid, or the folder holds something else.
        NoRendering: This machine cannot render.
        RunFailure: A scene did not come about.
    """
    cases, config = cases_of("place", options.part), options.common.load_config()
    check_counts(options, "views", "views_per_scene")
    kind = config.workcell.fixture
    if fixture_class(kind).custom:
        raise BadUsage(f"Fixture '{kind}' is made for one posture: name another.")
    if reason := rendering_problem():
        raise NoRendering(f"pictures cannot be taken: {reason}")
    root, counts = Path(options.common.out), _counts(options)
    made_from = _made_from(options, config)
    _check_ours(root, made_from, len(counts))
    with output_folder(root, RECORD):
        record = _record(root, made_from, counts)
        collector = _Collector(options, config, load_product(PRODUCT), cases)
        number, X_PO = _write_start(root, collector)
        console, pinhole = Console(quiet=options.common.quiet), collector.studio.camera.pinhole
        for k, count in enumerate(counts):
            if str(k) in record["scenes"]:
                continue
            case, placed, scene = collector.scene(k, count)
            write_scene(root, k, scene.images, pinhole, number, X_PO)
            with whole_file(root / "pictures" / f"{k:06d}.png") as file:
                file.write_bytes(scene.picture)
            record["scenes"][str(k)] = {
                "case": case.label,
                "press_force": placed.press_force,
                "views_missed": scene.missed,
                **summary(scene.errors),
                "label_errors": [asdict(error) for error in scene.errors],
            }
            write_json(root / RECORD, record)
            console.print(f"scene {k}: {case.label}, {count} views, {scene.missed} missed")
        errors = [
            LabelError(**error)
            for scene in record["scenes"].values()
            for error in scene["label_errors"]
        ]
        record |= {"status": "complete", "summary": summary(errors)}
        write_json(root / RECORD, record)
    console.print(_table(record))
    return 0


@dataclass
class _Collector:
    """Places the part and takes pictures, with what is costly to build kept."""

    options: Options
    config: CellConfig
    product: Product
    cases: list[Case]
    _benches: dict[str, RigBench] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.studio = Studio(self.config, self.product)

    def scene(self, number: int, count: int) -> tuple[Case, Placed, Scene]:
        """Return a scene by its number, always the same.

        Raises:
            RunFailure: No attempt succeeded.
        """
        case = self.cases[number % len(self.cases)]
        if case.label not in self._benches:
            self._benches[case.label] = RigBench.build(self.config, self.product, case.posture)
        reason = ""
        for attempt in range(ATTEMPTS):
            rng = case_seed(self.options.common.seed, case.label, number * ATTEMPTS + attempt)
            try:
                placed = press_in(self._benches[case.label], rng)
                self.studio.go_home()
                found = collect_scene(self.studio, case.posture.part, placed, count, rng)
                return case, placed, found
            except (PhaseFailed, Unlabelled) as error:
                reason = str(error)
        raise RunFailure(f"Scene {number} ({case.label}): {ATTEMPTS} attempts failed: {reason}")


def _write_start(root: Path, collector: _Collector) -> tuple[int, RigidTransform]:
    """Write what the scenes share; return the number of the object and its model's frame X_PO."""
    part = collector.cases[0].posture.part
    # A part has its number whatever else is collected.
    number = sorted({case.posture.part for case in cases_of("place", None)}).index(part) + 1
    mesh = collector.product.parts[part].mesh
    write_head(root, collector.studio.camera.pinhole, {number: mesh})
    X_PO = box_centre(mesh)
    x, y, z = 1e3 * X_PO.translation()
    views = collector.options.views
    write_text(
        root / "dataset_info.md", INFO.format(part=part, views=views, number=number, x=x, y=y, z=z)
    )
    (root / "pictures").mkdir(exist_ok=True)
    return number, X_PO


def _counts(options: Options) -> list[int]:
    """Return the number of pictures of each scene."""
    full, rest = divmod(options.views, options.views_per_scene)
    return [options.views_per_scene] * full + [rest] * (rest > 0)


def _made_from(options: Options, config: CellConfig) -> dict[str, Any]:
    """Return what decides about the content of a scene."""
    chosen = {name: getattr(options, name) for name in ("part", "views_per_scene")}
    settings = json.loads(json.dumps(finite(config.to_dict())))
    return chosen | {"seed": options.common.seed, "config": settings}


def _check_ours(root: Path, made_from: dict[str, Any], scenes: int) -> None:
    """Refuse a folder with another dataset in it, or with more than is asked for.

    Raises:
        InputError: It holds one that was made from something else, or of which nothing is known.
    """
    file = root / RECORD
    if not file.is_file():
        if any((root / name).exists() for name in (SPLIT, "models", "camera.json")):
            raise InputError(
                f"'{root}' holds a dataset without {RECORD}, whole or not: name another folder "
                "with --out, or remove it."
            )
        return
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        known, there = record["made_from"], [int(number) for number in record["scenes"]]
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise InputError(f"'{file}' cannot be read: name another folder with --out.") from error
    other = [name for name in made_from if known.get(name) != made_from[name]]
    if other:
        given = ", ".join(
            name if name == "config" else f"{name} {known.get(name)}, not {made_from[name]}"
            for name in other
        )
        raise InputError(
            f"'{root}' holds another collection ({given}): name another folder with --out."
        )
    if there and max(there) >= scenes:
        raise InputError(
            f"'{root}' holds {max(there) + 1} scenes, --views asks for {scenes}: name another "
            "folder with --out."
        )


def _record(root: Path, made_from: dict[str, Any], counts: list[int]) -> dict[str, Any]:
    """Return what has been collected; scenes that are not there as a whole are left out."""
    file = root / RECORD
    record: dict[str, Any] = {"made_from": made_from, "scenes": {}}
    if file.is_file():
        record = json.loads(file.read_text(encoding="utf-8"))
    kept = {
        number: scene
        for number, scene in record["scenes"].items()
        if scene_folder(root, int(number)).is_dir() and scene["images"] == counts[int(number)]
    }
    record |= {"status": "running", "scenes": kept, "versions": versions()}
    record.pop("summary", None)
    for partial in (root / SPLIT).glob(".*.part"):
        shutil.rmtree(partial, ignore_errors=True)
    write_json(file, record)
    return record


def _table(record: dict[str, Any]) -> Table:
    title = "Labels against the truth: medians, and what 95 % stay within; overlap of visible masks"
    table = Table(title=title, title_justify="left")
    for heading in ("scene", "camera mm", "deg", "label mm", "deg", "mask"):
        table.add_column(heading, justify="left" if heading == "scene" else "right")
    rows = {f"{k} {scene['case']}": scene for k, scene in record["scenes"].items()}
    for label, row in (rows | {"all": record["summary"]}).items():
        pairs = [f"{row[f'{name}_50']:.{digits}f}/{row[f'{name}_95']:.{digits}f}"
                 for name, digits in (("camera_mm", 2), ("camera_deg", 3), ("label_mm", 2),
                                      ("label_deg", 2))]  # fmt: skip
        overlap = f"{row['mask_overlap_50']:.3f}/{row['mask_overlap_5']:.3f}"
        table.add_row(label, *pairs, overlap)
    return table


if __name__ == "__main__":
    sys.exit(main())
