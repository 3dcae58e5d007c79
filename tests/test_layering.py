"""The shape of the source tree: imports point one way, and no file outgrows a reader."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ALLOWED = {"cell": set(), "planning": {"cell"}, "experiments": {"cell", "planning"}}
SOURCES = sorted(f for p in [*ALLOWED, "tests"] for f in (ROOT / p).rglob("*.py"))
# The folders and single files of a package, from the lowest up, each with what it may use of the
# same package. Some are for all of cell: see `EVERYWHERE`.
LAYERS: dict[str, dict[str, set[str]]] = {
    "cell": {
        "errors": set(),
        "whole_file": {"errors"},
        "paths": set(),
        "bodies": set(),
        "setting": set(),
        "shapes": set(),
        "forces": set(),
        "vectors": set(),
        "yaml_text": {"errors"},
        "contact": set(),
        "sleep": {"contact"},
        "monitor": set(),
        "products": set(),
        "fixtures": {"contact"},
        "configuration": {"fixtures"},
        "machines": {"configuration", "fixtures"},
        "workpieces": {"configuration", "fixtures", "machines", "products"},
        "ports": {"workpieces"},
        "link_policy": {"contact", "fixtures", "machines", "workpieces"},
        "cad": {"fixtures", "machines", "products"},
        "builder": {
            "configuration", "contact", "fixtures", "link_policy", "machines", "monitor", "ports",
            "products", "workpieces",
        },
        "simulation": {
            "builder", "configuration", "fixtures", "machines", "products", "workpieces",
        },
    },
    "planning": {
        "feasibility": set(),
        "fixture_analysis": {"feasibility"},
        "ordering": {"feasibility", "fixture_analysis"},
        "assembly_plan": {"feasibility", "fixture_analysis", "ordering"},
        "motion": set(),
        "perception": set(),
        "operations": {"feasibility", "motion", "assembly_plan", "perception"},
        "product_draft": {"feasibility", "fixture_analysis", "assembly_plan"},
        "product_check": {
            "feasibility", "fixture_analysis", "assembly_plan", "motion", "operations",
            "product_draft",
        },
    },
    "experiments": {
        "reporting": set(),
        "plan": {"reporting"},
        "assembly": {"reporting"},
        "campaigns": {"reporting", "assembly"},
        "product": {"reporting", "assembly"},
        "speed": {"reporting", "assembly"},
        "jig": {"campaigns"},
        "calibration": {"reporting", "campaigns", "jig"},
        "paper": {"reporting", "campaigns", "speed"},
        "fixtures": {"reporting", "campaigns", "product", "paper"},
        "vision": {"reporting", "paper"},
        "compare": {"reporting", "campaigns"},
        "regress": {"reporting", "campaigns", "speed", "jig", "paper", "compare"},
        "studies": {"reporting", "assembly", "campaigns", "product", "paper", "compare"},
        "cli": {
            "reporting", "plan", "assembly", "campaigns", "product", "paper", "compare", "regress",
        },
    },
}  # fmt: skip
EVERYWHERE = {
    "cell": {
        "bodies", "errors", "paths", "setting", "shapes", "forces", "sleep", "vectors",
        "whole_file", "yaml_text",
    },
    "planning": set(),
    "experiments": set(),
}  # fmt: skip
EVERY_LAYER = [(package, layer) for package, layers in LAYERS.items() for layer in layers]
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


def files_of(package: str, layer: str) -> list[Path]:
    single = ROOT / package / f"{layer}.py"
    return [single] if single.exists() else sorted((ROOT / package / layer).rglob("*.py"))


def used_of(package: str, file: Path) -> set[str]:
    """Return the folders and files of a package that a source file imports, by first name."""
    names = [name.split(".") for name in imported_modules(file)]
    return {name[1] for name in names if name[0] == package and len(name) > 1}


@pytest.mark.parametrize("package", ALLOWED)
def test_imports_point_one_way(package: str) -> None:
    """Experiments may use planning, planning may use cell, and never back."""
    for file in (ROOT / package).rglob("*.py"):
        roots = {name.split(".")[0] for name in imported_modules(file)}
        beyond = (roots & set(ALLOWED)) - {package} - ALLOWED[package]
        assert not beyond, f"{name_of(file)} imports {sorted(beyond)}"


@pytest.mark.parametrize("package", LAYERS)
def test_every_layer_is_known(package: str) -> None:
    """Scripts of experiments apart, everything in a package has its place in the table."""
    folders = {file.relative_to(ROOT / package).parts[0] for file in (ROOT / package).rglob("*.py")}
    files = {name.removesuffix(".py") for name in folders if name.endswith(".py")} - {"__init__"}
    known = {name for name in folders if not name.endswith(".py")}
    known |= set() if package == "experiments" else files
    assert set(LAYERS[package]) == known


@pytest.mark.parametrize("package", LAYERS)
def test_layers_are_listed_from_the_lowest_up(package: str) -> None:
    """What a layer may use stands before it: there are no cycles."""
    layers = list(LAYERS[package])
    for number, layer in enumerate(layers):
        assert LAYERS[package][layer] <= set(layers[:number]), layer


@pytest.mark.parametrize(("package", "layer"), EVERY_LAYER)
def test_layers_use_only_those_below(package: str, layer: str) -> None:
    for file in files_of(package, layer):
        beyond = used_of(package, file) - {layer} - LAYERS[package][layer] - EVERYWHERE[package]
        assert not beyond, f"{name_of(file)} uses {sorted(beyond)}"


def test_no_file_imports_itself_through_others() -> None:
    """Not for type checkers only, either. Packages' own `__init__` files only hand names on."""
    files = {
        ".".join(f.relative_to(ROOT).with_suffix("").parts): f
        for package in ALLOWED
        for f in (ROOT / package).rglob("*.py")
        if f.name != "__init__.py"
    }
    graph = {name: imported_modules(file) & set(files) for name, file in files.items()}
    TopologicalSorter(graph).prepare()  # Raises CycleError, which names the circle.


def test_scripts_use_layers_and_not_each_other() -> None:
    for file in (ROOT / "experiments").glob("*.py"):
        beyond = used_of("experiments", file) - set(LAYERS["experiments"])
        assert not beyond, f"{name_of(file)} uses {sorted(beyond)}"


@pytest.mark.parametrize("file", SOURCES, ids=name_of)
def test_file_is_readable_and_imports_by_name(file: Path) -> None:
    """No file over the limit; pydrake names come from their submodules; imports are absolute."""
    assert len(file.read_text().splitlines()) <= MAX_LINES
    assert "pydrake.all" not in imported_modules(file)
    assert "" not in imported_modules(file), "relative import"
