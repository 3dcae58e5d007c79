"""Cache of matrices, keyed by content: planning the same parts again only reads a file.

The key is a digest of everything that determines the matrices: vertices and faces of every part in
the product frame, everything declared, the tolerance, this package's own source and the versions of
the libraries that compute, so that a new version never reads results of an old one. A file that
cannot be read, or is not what was written, counts as absent.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from cell.errors import CellError
from cell.products.product import Product
from cell.whole_file import whole_file
from planning.feasibility.cad_threads import CadThread
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.interference import Blocker, Interference
from planning.feasibility.matrices import AssemblyMatrices, Progress, matrices_of
from planning.feasibility.overlaps import Overlap, Overlaps
from planning.feasibility.solids import Solid, solids_of
from planning.feasibility.tolerance import Tolerances
from planning.feasibility.undercut import Undercut

LIBRARIES = ("manifold3d", "numpy", "python-fcl", "scipy", "trimesh")  # What computes the matrices.
CHECKSUM = "checksum"  # Of a file, over everything else in it.


def user_cache() -> Path | None:
    """Return the user's cache folder: ``$XDG_CACHE_HOME/soft-jig``, or ``~/.cache/soft-jig``.

    None for a user without a home, as in containers.
    """
    root = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(root) if root else Path.home() / ".cache") / "soft-jig"
    except RuntimeError:
        return None


def cached_matrices(
    product: Product,
    tolerance: float | None,
    folder: Path,
    progress: Progress = lambda done, total: None,
) -> AssemblyMatrices:
    """Return what ``matrices_of`` returns, read from the folder if it was computed before."""
    solids = solids_of(product)
    file = folder / f"{key_of(product, solids, tolerance)}.npz"
    found = load_matrices(file, solids)
    if found is None:
        found = matrices_of(product, tolerance, solids, progress)
        save_matrices(found, file)
    return found


def key_of(product: Product, solids: Mapping[str, Solid], tolerance: float | None) -> str:
    """Return a digest of everything that determines the matrices of a product."""
    digest = hashlib.blake2b(_source_digest(), digest_size=20)
    screws = sorted((f.part, f.into, f.pitch) for f in product.screws.values())
    pairs = [[sorted(pair) for pair in kind] for kind in _declared_pairs(product)]
    parts = [sorted(product.declared.flexible), product.declared.accept_all]
    lengths = [tolerance, product.contact_tolerance]
    digest.update(json.dumps([lengths, screws, [sorted(kind) for kind in pairs], parts]).encode())
    for name, solid in solids.items():
        digest.update(f"{name} {solid.vertices.shape} {solid.faces.shape}".encode())
        digest.update(np.asarray(solid.vertices, float).tobytes())
        digest.update(np.asarray(solid.faces, np.int64).tobytes())
    return digest.hexdigest()


def _declared_pairs(product: Product) -> list[frozenset[frozenset[str]]]:
    return [product.declared.accept, product.declared.press, product.declared.snap]


@cache
def _source_digest() -> bytes:
    digest = hashlib.blake2b()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    digest.update(json.dumps([version(library) for library in LIBRARIES]).encode())
    return digest.digest()


def save_matrices(matrices: AssemblyMatrices, file: Path) -> None:
    """Write matrices to a file; do nothing if the folder cannot be written to."""
    text = {
        "names": list(matrices.solids),
        "tolerances": asdict(matrices.tolerances),
        "overlaps": asdict(matrices.overlaps),
        "undercuts": [asdict(one) for one in matrices.undercuts],
        "blockers": [[b.moving, b.staying, b.direction] for b in matrices.interference.blockers],
    }
    arrays = {
        "text": np.array(json.dumps(text)),
        "contact": matrices.contact,
        "contact_margin": matrices.contact_margin,
        "free": np.array([matrices.interference.free[j] for j in DIRECTIONS], np.int8),
        "margin": np.array([matrices.interference.margin[j] for j in DIRECTIONS]),
        "hits": np.array([[*b.p_AoQ, b.travel] for b in matrices.interference.blockers]).reshape(
            -1, 4
        ),
    }
    arrays[CHECKSUM] = np.array(_checksum(arrays))
    with suppress(OSError, CellError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as temporary, temporary.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)


def load_matrices(file: Path, solids: Mapping[str, Solid]) -> AssemblyMatrices | None:
    """Return what ``save_matrices`` wrote for these parts, or None if there is no such file."""
    try:
        with np.load(file) as arrays:
            found = {name: arrays[name] for name in arrays.files}
        stated = str(found.pop(CHECKSUM))
        return _restored(found, solids) if stated == _checksum(found) else None
    except Exception:  # Damaged archives raise nearly anything: what is read is a copy, not needed.
        return None


def _checksum(arrays: Mapping[str, np.ndarray]) -> str:
    digest = hashlib.blake2b(digest_size=20)
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _restored(arrays: Mapping[str, Any], solids: Mapping[str, Solid]) -> AssemblyMatrices | None:
    text = json.loads(str(arrays["text"]))
    if text["names"] != list(solids):
        return None
    blockers = tuple(
        Blocker(moving, staying, direction, (x, y, z), travel)
        for (moving, staying, direction), (x, y, z, travel) in zip(
            text["blockers"], arrays["hits"].tolist(), strict=True
        )
    )
    free = {j: arrays["free"][k].astype(int) for k, j in enumerate(DIRECTIONS)}
    margin = {j: arrays["margin"][k] for k, j in enumerate(DIRECTIONS)}
    overlaps = text["overlaps"]
    threads = (
        CadThread(**thread | {key: tuple(thread[key]) for key in ("axis", "p_AoT")})
        for thread in overlaps["threads"]
    )
    others = (Overlap(**one | {"p_AoD": tuple(one["p_AoD"])}) for one in overlaps["others"])
    return AssemblyMatrices(
        solids,
        Tolerances(**text["tolerances"]),
        arrays["contact"],
        arrays["contact_margin"],
        Interference(free, blockers, margin),
        Overlaps(tuple(threads), tuple(map(tuple, overlaps["screws"])), tuple(others)),
        tuple(Undercut(**one) for one in text["undercuts"]),
    )
