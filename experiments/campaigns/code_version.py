"""Digests that identify a trial: of the code that simulates, of a product, of the whole trial."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import cell
import planning
from cell.configuration.config import CellConfig
from cell.paths import FILE_URL, MODELS
from cell.products.loading import load_product
from cell.simulation.identity import product_digest
from experiments.reporting.provenance import versions

EXPERIMENTS = Path(__file__).resolve().parent.parent
LENGTH = 20  # Hexadecimal digits: 80 bits, so that a million trials do not meet by chance.


@cache
def code_digest(script: Path) -> str:
    """Return a digest of sources and models that simulate, and of the versions of packages.

    Args:
        script: The file of the experiment's function. Modules of its own that it imports are not
            seen.
    """
    packages = [Path(package.__file__ or "").parent for package in (cell, planning)]
    parts = [EXPERIMENTS / name for name in ("assembly", "jig", "paper", "product")]
    digest = hashlib.sha256(repr(sorted(versions().items())).encode())
    for folder in (*packages, *parts):
        _add_files(digest, folder, folder.rglob("*.py"))
    _add_files(digest, MODELS, (MODELS / "sdf").rglob("*.*"))
    digest.update(script.read_bytes())
    return digest.hexdigest()[:LENGTH]


def _add_files(digest: Any, base: Path, files: Iterable[Path]) -> None:
    for file in sorted(files):
        if file.is_file():
            digest.update(f"{file.relative_to(base).as_posix()}\n".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())


@cache
def content_of(product: str) -> str:
    """Return a digest of all that a product's file says, and of the models of its own.

    Raises:
        InputError: It cannot be read.
    """
    found = load_product(product)
    digest = hashlib.sha256(product_digest(found).encode())
    for part in found.parts.values():
        for grasp in part.grasps:
            text = f"{part.name} {grasp.name} {grasp.jaw} {grasp.width} {grasp.force}"
            digest.update(text.encode() + grasp.X_PJaw.GetAsMatrix34().tobytes())
    declared = [
        sorted(map(sorted, getattr(found.declared, k))) for k in ("accept", "press", "snap")
    ]
    declared += [sorted(found.declared.flexible), found.declared.accept_all]
    rest = [sorted(found.groups.items()), found.orders, found.up, found.contact_tolerance, declared]
    digest.update(repr(rest).encode())
    models = [found.tray or "", *(part.model or "" for part in found.parts.values())]
    for url in sorted({model for model in models if model.startswith(FILE_URL)}):
        folder = Path(url.removeprefix(FILE_URL)).parent
        _add_files(digest, folder, folder.rglob("*.*"))
    return digest.hexdigest()


def trial_key(
    experiment: str,
    product: str,
    config: CellConfig,
    seed: int,
    options: Mapping[str, Any],
    code: str,
) -> str:
    """Return the key of a trial: the same on every machine, for the same numbers and code.

    Args:
        experiment: Name of its function, without the folder that it lies in.
        product: Name or file.
        config: Of the cell.
        seed: Of everything that is random.
        options: Of the experiment's own.
        code: Digest of the code.
    """
    identity = [experiment, content_of(product), config.to_dict(), seed, dict(options), code]
    text = json.dumps(identity, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:LENGTH]
