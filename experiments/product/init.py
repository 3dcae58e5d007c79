"""``soft-jig init``: read CAD, draft a product, write it as files that a person can edit."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.products.loading import is_product_file, load_product
from cell.products.materials import DEFAULT_MATERIAL, DENSITIES
from cell.products.model_files import OWN_MODELS
from cell.products.product import Product
from cell.products.read_options import ReadOptions
from experiments.assembly.prepare import RunningCell
from experiments.reporting.output import output_folder
from planning.assembly_plan.planner import plan
from planning.feasibility.directions import DIRECTIONS
from planning.product_check.check import plan_findings
from planning.product_check.reach import reached_grasps
from planning.product_draft.draft import Draft, DraftOptions, draft_product
from planning.product_draft.product_text import product_text
from planning.product_draft.reach import within_reach

PRODUCT_FILE = "product.yaml"


@dataclass(frozen=True)
class Wanted:
    """What a person gave; see `experiments.cli.init.Init`."""

    source: Path
    units: str | None = None
    materials: Sequence[str] = ()
    strength: str = "8.8"
    torque: float | None = None
    order: tuple[str, ...] | None = None
    up: str | None = None
    split: bool = False
    leave_out: tuple[str, ...] = ()


def run_init(wanted: Wanted, out: Path, config: CellConfig, *, quiet: bool) -> int:
    """Draft a product and write it into a folder; nothing is written if that fails.

    Raises:
        InputError: Something that was given cannot be used, or the folder holds a product already.
        RunFailure: The parts cannot be assembled.
    """
    started = time.perf_counter()
    console = Console(quiet=quiet, highlight=False)
    product = _read(wanted)
    options = DraftOptions(
        _materials(wanted.materials), wanted.strength, wanted.torque, wanted.order, config
    )
    with output_folder(out) as folder, tempfile.TemporaryDirectory(dir=folder) as draft_folder:
        if (folder / PRODUCT_FILE).exists():
            raise InputError(f"'{folder / PRODUCT_FILE}' exists; --out names another folder.")
        own = Path(draft_folder)
        draft = draft_product(product, own, options)
        (own / PRODUCT_FILE).write_text(product_text(draft))
        draft = _within_reach(draft, load_product(own / PRODUCT_FILE), config)
        (own / PRODUCT_FILE).write_text(product_text(draft))
        load_product(own / PRODUCT_FILE)  # What cannot be read back is not handed over.
        for name in (OWN_MODELS, PRODUCT_FILE):
            shutil.move(own / name, folder / name)
    for note in product.notes:
        console.print(note, markup=False, soft_wrap=True)
    console.print(_table(draft))
    file = out / PRODUCT_FILE
    seconds = time.perf_counter() - started
    console.print(f"{file} written in {seconds:.1f} s. Next: soft-jig check {file}", soft_wrap=True)
    return 0


def _within_reach(draft: Draft, product: Product, config: CellConfig) -> Draft:
    """Return a draft without the grasps that no step can use; all of them if there are no steps.

    Args:
        draft: What was drafted.
        product: The same as a run reads it, with its models.
        config: The cell.
    """
    _, todo = plan_findings(product, plan(product, config=config))
    if not todo:
        return draft
    reached = reached_grasps(RunningCell(product, config, seed=0).station, todo)
    kept, guesses = within_reach(draft.product, reached)
    return replace(draft, product=kept, guesses=(*draft.guesses, *guesses))


def _read(wanted: Wanted) -> Product:
    if is_product_file(str(wanted.source)):
        raise InputError(f"'{wanted.source}' is a product already; init takes CAD.")
    if wanted.torque is not None and not 0.0 < wanted.torque < 1e3:
        raise InputError(f"--torque must be above zero, in N m, not {wanted.torque:g}.")
    if wanted.up is not None and wanted.up not in DIRECTIONS:
        raise InputError(f"--up is one of {', '.join(DIRECTIONS)}, not '{wanted.up}'.")
    # Materials, and with them masses, are guessed later: no remark on a density is due here.
    options = ReadOptions(
        units=wanted.units,
        split=wanted.split,
        leave_out=wanted.leave_out,
        densities={"": DENSITIES[DEFAULT_MATERIAL]},
    )
    product = load_product(wanted.source, options)
    return replace(product, up=wanted.up or product.up)


def _materials(texts: Sequence[str]) -> dict[str, str]:
    """Return materials by part, "" for all, of texts like "steel" or "bush=brass"."""
    found = {}
    for text in texts:
        name, _, material = text.rpartition("=")
        found[name.strip()] = material.strip()
    return found


def _table(draft: Draft) -> Table:
    table = Table("part", "guess", "because", "sure")
    for guess in draft.guesses:
        table.add_row(guess.subject, guess.what, guess.reason, f"{100 * guess.confidence:.0f} %")
    return table
