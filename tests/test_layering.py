"""The shape of the source tree: imports point one way, and no file outgrows a reader."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ALLOWED = {"cell": set(), "planning": {"cell"}, "experiments": {"cell", "planning"}}
SOURCES = sorted(f for p in [*ALLOWED, "tests"] for f in (ROOT / p).rglob("*.py"))
# The rooms of a package, from the lowest up, each with those that it may use.
ROOMS = {
    "cell": {
        "soft_jig": set(),
        "settings": {"soft_jig"},
        "products": set(),
        "cad": {"products"},
        "workpieces": {"products"},
        "machines": {"settings", "workpieces"},
        "running": {"soft_jig", "settings", "products", "workpieces", "machines"},
        "trial": {"soft_jig", "settings", "products", "workpieces", "machines", "running"},
    },
    "planning": {
        "fixing": set(),
        "holding": {"fixing"},
        "ordering": {"fixing", "holding"},
        "plans": {"fixing", "holding", "ordering"},
        "motion": set(),
        "operations": {"fixing", "motion", "plans"},
    },
    "experiments": {
        "reporting": set(),
        "metrics": set(),
        "jig": set(),
        "plan": {"reporting"},
        "assembly": {"reporting", "metrics"},
        "paper": {"reporting", "metrics"},
        "cli": {"reporting", "plan", "assembly", "paper"},
    },
}
# Files beside the rooms of cell that any room may use, and that use none. Those of experiments are
# scripts: they may use any room, and nothing uses them.
LEAVES = {"cell": {"errors", "paths"}, "planning": set(), "experiments": set()}
EVERY_ROOM = [(package, room) for package, rooms in ROOMS.items() for room in rooms]
MAX_LINES = 400  # A few screens: beyond that a file holds more than its name says.


def imported_modules(file: Path) -> set[str]:
    """Return the dotted names of the modules that a source file imports, at any level."""
    nodes = list(ast.walk(ast.parse(file.read_text())))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            module = node.module or ""
            # `from experiments import x` may name a module as well.
            names |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return names


def name_of(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("package", ALLOWED)
def test_imports_point_one_way(package: str) -> None:
    """Experiments may use planning, planning may use cell, and never back."""
    for file in (ROOT / package).rglob("*.py"):
        roots = {name.split(".")[0] for name in imported_modules(file)}
        beyond = (roots & set(ALLOWED)) - {package} - ALLOWED[package]
        assert not beyond, f"{name_of(file)} imports {sorted(beyond)}"


def used_of(package: str, file: Path) -> set[str]:
    """Return the rooms and files of a package that a source file imports, by first name."""
    names = [name.split(".") for name in imported_modules(file)]
    return {name[1] for name in names if name[0] == package and len(name) > 1}


@pytest.mark.parametrize("package", ROOMS)
def test_every_room_is_known(package: str) -> None:
    assert set(ROOMS[package]) == {file.parent.name for file in (ROOT / package).glob("*/*.py")}


@pytest.mark.parametrize("package", ROOMS)
def test_rooms_are_listed_from_the_lowest_up(package: str) -> None:
    """What a room may use stands before it: there are no cycles."""
    rooms = list(ROOMS[package])
    for number, room in enumerate(rooms):
        assert ROOMS[package][room] <= set(rooms[:number]), room


@pytest.mark.parametrize(("package", "room"), EVERY_ROOM)
def test_rooms_use_only_those_below(package: str, room: str) -> None:
    for file in (ROOT / package / room).rglob("*.py"):
        beyond = used_of(package, file) - {room} - ROOMS[package][room] - LEAVES[package]
        assert not beyond, f"{name_of(file)} uses {sorted(beyond)}"


def test_files_beside_the_rooms_of_cell_use_nothing_of_it() -> None:
    """Except for the package itself: it hands out the public names."""
    files = {file.stem: file for file in (ROOT / "cell").glob("*.py")}
    assert set(files) == {"__init__", *LEAVES["cell"]}
    for name in LEAVES["cell"]:
        assert not used_of("cell", files[name]), name


def test_scripts_use_rooms_and_not_each_other() -> None:
    for file in (ROOT / "experiments").glob("*.py"):
        beyond = used_of("experiments", file) - set(ROOMS["experiments"])
        assert not beyond, f"{name_of(file)} uses {sorted(beyond)}"


@pytest.mark.parametrize("file", SOURCES, ids=name_of)
def test_file_is_readable_and_imports_by_name(file: Path) -> None:
    """No file over the limit; pydrake names come from their submodules; imports are absolute."""
    assert len(file.read_text().splitlines()) <= MAX_LINES
    assert "pydrake.all" not in imported_modules(file)
    assert "" not in imported_modules(file), "relative import"
