"""Products that are drawn in code, drafted by ``init`` and checked: no file is touched by hand."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from manifold3d import Manifold

from cell.configuration.config import CellConfig
from cell.errors import CellError
from cell.products.loading import load_product
from experiments.product.check import find
from experiments.product.init import PRODUCT_FILE, Wanted, run_init
from experiments.product.random_drawing import write_cad
from experiments.reporting.output import write_json
from planning.product_check.finding import Level

DRAFT = "draft.json"  # What drafting and checking it took and said.


@dataclass(frozen=True)
class Draft:
    """A product that was drafted and checked.

    Attributes:
        file: Of the product; where `init` refuses it there is none.
        seconds: CPU time of init and check [s].
        against: Why `init` refuses it, or what `check` says would fail.
    """

    file: str
    seconds: tuple[float, float]
    against: list[str]


def drafted(
    parts: Mapping[str, Manifold],
    folder: Path,
    config: CellConfig,
    *,
    seed: int = 0,
    materials: tuple[str, ...] = (),
) -> Draft:
    """Write meshes, draft and check their product, unless that was done in this folder.

    Args:
        parts: By name, assembled [mm].
        folder: For meshes, product and draft; made if it does not exist.
        config: Of the cell.
        seed: Of the check.
        materials: As of ``init``.
    """
    own, said = folder / "own", folder / DRAFT
    if said.exists():
        kept = json.loads(said.read_text())
        return Draft(kept["file"], tuple(kept["seconds"]), kept["against"])
    shutil.rmtree(own, ignore_errors=True)  # Of a draft that was interrupted.
    cad = write_cad(parts, folder / "cad")
    clock = [time.process_time()]
    try:
        run_init(Wanted(cad, "mm", materials), own, config, quiet=True)
        clock.append(time.process_time())
        found = find(load_product(own / PRODUCT_FILE), None, config, seed)
        against = [f"{f.subject}: {f.text}" for f in found if f.level is Level.FAILS]
    except CellError as error:
        against = [str(error)]
    clock += [time.process_time()] * (3 - len(clock))
    seconds = clock[1] - clock[0], clock[2] - clock[1]
    draft = Draft(str(own / PRODUCT_FILE), seconds, against)
    write_json(said, asdict(draft))
    return draft
