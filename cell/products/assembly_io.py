"""Reading assemblies from one file, STEP or glTF, as a tree of parts with triangle meshes.

OpenCASCADE, through ``cascadio``, converts STEP to glTF, which is in metres by its specification,
whatever the unit of the STEP file. Names are taken from the text of the STEP file.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path, PureWindowsPath

from cell.errors import InputError
from cell.products.gltf import gltf_tree
from cell.products.step_text import StepText
from cell.products.tree import Node, authored

GLTF_SUFFIX = ".glb"
STEP_SUFFIXES = (".step", ".stp", ".p21")
ASSEMBLY_SUFFIXES = (*STEP_SUFFIXES, GLTF_SUFFIX)

DEFLECTION = 0.005
"""[mm] [D] a tenth of the usual tolerance on fits."""

DEFLECTION_PER_TOLERANCE = 0.1
"""[D] of the tolerance that a user gives: the same tenth."""

FACET_ANGLE = 0.25
"""[rad] [D] for small circles. OpenCASCADE keeps to half of both limits [M]: 51 facets a turn have
a sagitta of r/527, below the r/500 that counts as line to line even between parts of that size.
From 1.3 mm on, ``DEFLECTION`` asks for more: 109 facets on a hole of 12 mm."""

CONVERTER = Path(__file__).with_name("step_to_gltf.py")

# What converting a file may take; [M] solids of plane faces take 0.8 s and 25 MB per MB.
CPU_SECONDS, CPU_SECONDS_PER_MB = 40, 10.0
MEMORY, MEMORY_PER_BYTE = 2 << 30, 100  # [byte]


def load_assembly(file: Path, tolerance: float | None = None, above: tuple[Path, ...] = ()) -> Node:
    """Read a file as a tree, in its assembled pose [m]; what it refers to is read from beside it.

    Args:
        file: One of ``ASSEMBLY_SUFFIXES``.
        tolerance: Gap that counts as contact [m], if STEP may be as coarse as that allows.
        above: Files that refer to this one.

    Raises:
        InputError: The file cannot be read.
    """
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(f"'{file}' cannot be read: {error.strerror}.") from error
    if file.suffix.lower() == GLTF_SUFFIX:
        return _authored(gltf_tree(data, file))
    text = StepText(data)
    deflection = DEFLECTION
    if tolerance is not None:
        deflection = max(deflection, 1e3 * DEFLECTION_PER_TOLERANCE * tolerance)
    binary = _converted(text.with_keys(), deflection, file)
    if not binary:
        raise InputError(f"'{file}' is not a STEP file that can be read.")
    tree = gltf_tree(binary, file)
    return _StepTree(file, text, tolerance, above).named(tree)


def referred_files(file: Path) -> list[Path]:
    """Return the files, beside a STEP file, in which it says that shapes of its products are."""
    if file.suffix.lower() not in STEP_SUFFIXES:
        return []
    documents = StepText(file.read_bytes()).documents()
    found = {_beside(file, name) for names in documents.values() for name in names}
    return sorted(f for f in found if f is not None and f != file)


class _StepTree:
    """Names for the tree that OpenCASCADE made of a STEP file, and what it left out of it."""

    def __init__(
        self, file: Path, text: StepText, tolerance: float | None, above: tuple[Path, ...]
    ) -> None:
        self._file = file
        self._text = text
        self._tolerance = tolerance
        self._above = (*above, file.resolve())
        self._documents = text.documents()
        self._seen: set[int] = set()
        self._loaded: dict[Path, Node] = {}

    def named(self, tree: Node) -> Node:
        """Return the tree with names by the author, and with every instance of the file in it."""
        roots = self._text.roots
        only = roots[0] if len(roots) == len(tree.children) == 1 else 0
        children = [self._renamed(child, only) for child in tree.children]
        lost = [
            Node(authored(usage.given), authored(usage.product), lacking="no shape in the file")
            for number, usage in self._text.usages.items()
            if number not in self._seen
        ]
        if len(children) == 1 and children[0].children:
            children = [replace(children[0], children=(*children[0].children, *lost))]
            lost = []
        return replace(tree, children=(*children, *lost))

    def _renamed(self, node: Node, definition: int = 0, above: str = "") -> Node:
        key = node.given.removeprefix("#") if node.given.startswith("#") else ""
        if usage := self._text.usages.get(int(key) if key.isdigit() else 0):
            self._seen.add(int(key))
            definition, names = usage.child, (usage.given, usage.product)
        elif definition:
            names = "", self._text.products[definition]
        else:
            names = node.given, node.product
        given, product = map(authored, names)
        if not usage and not given and not product:
            product = above  # An assembly may have a solid of its own.
        own = self._text.products.get(definition, "")
        children = tuple(self._renamed(child, above=authored(own)) for child in node.children)
        node = replace(node, given=given, product=product, children=children)
        if not node.children and not node.surfaces and definition in self._documents:
            return self._from_documents(node, self._documents[definition])
        return node

    def _from_documents(self, node: Node, names: list[str]) -> Node:
        """Return an instance whose shape other files hold, as far as they lie beside this one."""
        found = []
        for name in names:
            file = _beside(self._file, name)
            if file is None or file.resolve() in self._above:
                reason = f"its shape is in '{name}', which is not beside '{self._file.name}'"
            elif file.suffix.lower() not in ASSEMBLY_SUFFIXES:
                reason = f"its shape is in '{name}', which is not a STEP file"
            else:
                if file not in self._loaded:
                    self._loaded[file] = load_assembly(file, self._tolerance, self._above)
                found += [child.moved(node.X_AP) for child in self._loaded[file].children]
                continue
            found.append(Node(product=node.name, lacking=reason))
        if len(found) == 1 and not found[0].children:
            return replace(found[0], given=node.given, product=node.product or found[0].product)
        return replace(node, children=tuple(found), lacking="")


def _beside(file: Path, name: str) -> Path | None:
    """Return the file that a name refers to, from the folder of another file; None if missing.

    Names come from whatever system: with folders of its own, and in any case of letters.
    """
    plain = PureWindowsPath(name)  # It splits at both kinds of slashes.
    for path in (file.parent / plain.as_posix(), file.parent / plain.name):
        if path.is_file():
            return path
    same = [f for f in sorted(file.parent.iterdir()) if f.name.lower() == plain.name.lower()]
    return same[0] if same else None


def _authored(node: Node) -> Node:
    """Return a tree whose names were given by its author."""
    children = tuple(_authored(child) for child in node.children)
    return replace(
        node, given=authored(node.given), product=authored(node.product), children=children
    )


def _converted(data: bytes, deflection: float, file: Path) -> bytes:
    """Return a STEP file as binary glTF, at a deflection [mm]; empty if it is not a STEP file.

    Raises:
        InputError: The reader crashes on it, or takes more time or memory than it may.
    """
    seconds = CPU_SECONDS + int(CPU_SECONDS_PER_MB * 1e-6 * len(data))
    memory = MEMORY + MEMORY_PER_BYTE * len(data)
    with tempfile.TemporaryDirectory(prefix="soft-jig-") as folder:
        result = Path(folder) / "result.glb"
        limits = map(str, (deflection, FACET_ANGLE, seconds, memory, result))
        # -P: the folder of the script holds modules with the names of others.
        done = subprocess.run(
            [sys.executable, "-P", CONVERTER, *limits], input=data, capture_output=True, check=False
        )
        if done.returncode == 0:
            return result.read_bytes()
    gigabytes = memory / 2**30
    reasons = {-signal.SIGXCPU: f"takes longer than {seconds} s", -signal.SIGKILL: "was killed"}
    if b"MemoryError" in done.stderr or b"bad_alloc" in done.stderr:
        reason = f"takes more than {gigabytes:.1f} GB"
    elif done.returncode < 0:
        name = signal.Signals(-done.returncode).name
        reason = reasons.get(done.returncode, f"crashes ({name})")
    else:
        reason = (done.stderr.decode(errors="replace").strip().splitlines() or ["fails"])[-1]
    raise InputError(f"'{file}' cannot be read: the reader of STEP files {reason}.")
