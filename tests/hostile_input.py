"""Hostile and careless input for the command line, seeded: products, configurations, meshes, paths.

Every case says what it is, which files it takes, and what a refusal has to name. ``fuzz.py`` runs
them.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass

from hostile_meshes import glb_cases, mesh_cases, obj_box, step_cases

from cell.configuration.config import CellConfig

PLAN = ("--no-cache", "--no-html", "--quiet", "--out", "out")
ANY = (0, 1, 2)


@dataclass(frozen=True)
class Case:
    """One input.

    Attributes:
        name: What is odd about it.
        arguments: Of the command line, in a folder with `files`.
        files: Content by path; None makes a folder.
        culprits: Of which a refusal names one.
        codes: Exit codes that are right.
        environment: Changes to the environment; None removes a variable.
        closed: Whether standard output is closed.
    """

    name: str
    arguments: tuple[str, ...]
    files: Mapping[str, bytes | None] = field(default_factory=dict)
    culprits: tuple[str, ...] = ()
    codes: tuple[int, ...] = (2,)
    environment: Mapping[str, str | None] = field(default_factory=dict)
    closed: bool = False


GOOD = b"""name: pair
units: mm
parts:
  a: {mesh: a.obj, mass_kg: 0.1, grasps: [{name: n, jaw: tip, at_mm: [0, 0, 0], closing: [1, 0, 0],
      approach: [0, 0, 1], width_mm: 1, force_N: 1, turn: {axis: [0, 0, 1], every_deg: 90}}]}
  b: {mesh: b.obj, mass_kg: 0.1, assembled_pose: {xyz_mm: [0, 0, 0], rpy_deg: [0, 0, 0]}}
groups: {both: [a, b]}
orders: [[both]]
joints: [{type: fit, shaft: a, hole: b, at_mm: [0, 0, 0], depth_mm: 5}]
"""
BOXES = {"a.obj": obj_box(), "b.obj": obj_box(20.0)}


def product(
    name: str,
    text: bytes | str,
    culprits: tuple[str, ...],
    codes=(2,),
    options: tuple[str, ...] = (),
) -> Case:
    """Return a case that plans a product file with two boxes beside it."""
    data = text.encode("utf-8") if isinstance(text, str) else text
    arguments = ("plan", "p.yaml", *PLAN, *options)
    return Case(name, arguments, {**BOXES, "p.yaml": data}, culprits, codes)


VALUES = {
    "nan": ".nan",
    "infinite": ".inf",
    "negative": "-1",
    "zero": "0",
    "huge": "1e308",
    "tiny": "1e-300",
    "400 digits": "9" * 400,
    "text": "abc",
    "long text": "x" * 5000,
    "list": "[1, 2]",
    "nested list": "[[1]]",
    "mapping": "{x: 1}",
    "null": "~",
    "boolean": "true",
    "date": "2020-99-99",
    "empty text": '""',
    "escape": r'"a\e]0;owned\a"',
    "NUL": r'"\0"',
    "surrogate": r'"\ud800"',
    "binary": "!!binary aGVsbG8=",
    "timestamp": "!!timestamp abc",
    "python": "!!python/object/apply:os.system ['touch pwned']",
    "unknown alias": "*nope",
}
# What stands in GOOD for each key, as it is replaced.
KEYS = {
    "name": b"name: pair",
    "units": b"units: mm",
    "mesh": b"mesh: a.obj",
    "mass_kg": b"mass_kg: 0.1",
    "xyz_mm": b"xyz_mm: [0, 0, 0]",
    "rpy_deg": b"rpy_deg: [0, 0, 0]",
    "closing": b"closing: [1, 0, 0]",
    "width_mm": b"width_mm: 1",
    "every_deg": b"every_deg: 90",
    "groups": b"groups: {both: [a, b]}",
    "orders": b"orders: [[both]]",
    "depth_mm": b"depth_mm: 5",
    "shaft": b"shaft: a",
}
VALID = {  # Values that are what the key asks for.
    "name": {"text", "long text", "date"},
    "groups": {"mapping"},
}


def product_values() -> Iterator[Case]:
    """Every odd value for every key of a product file."""
    for key, known in KEYS.items():
        for name, value in VALUES.items():
            text = GOOD.replace(known, f"{key}: {value}".encode(), 1)
            codes = ANY if name in VALID.get(key, ()) else (2,)
            culprits = (key, "p.yaml", "'a'", "No unit '", "No part '")
            yield product(f"{key}: {name}", text, culprits, codes)


def aliases(levels: int, width: int, one: str) -> str:
    """Return anchors of which each repeats the one before."""
    lines = [f"x0: &x0 {one}"]
    lines += [f"x{i}: &x{i} [{', '.join([f'*x{i - 1}'] * width)}]" for i in range(1, levels)]
    return "\n".join(lines) + "\n"


def merges(levels: int, width: int) -> str:
    """Return mappings of which each merges the one before many times."""
    lines = ["m0: &m0 {k: v}"]
    lines += [
        f"m{i}: &m{i} {{<<: [{', '.join([f'*m{i - 1}'] * width)}], k{i}: 1}}"
        for i in range(1, levels)
    ]
    return "\n".join(lines) + "\n"


def forms(good: str) -> dict[str, str | bytes]:
    """Return odd forms of a YAML file, by what is odd."""
    return {
        "aliases that multiply": aliases(12, 9, "[x]") + good,
        "merges that multiply": merges(9, 9) + good,
        "an alias of itself": "&r {parts: *r}\n",
        "an alias of itself in a list": "orders: &o [*o]\n",
        "a merge of itself": "parts: &p\n  <<: *p\n  a: 1\n",
        "a chain of aliases": "x0: &x0 [1]\n"
        + "".join(f"x{i}: &x{i} [*x{i - 1}]\n" for i in range(1, 2000)),
        "nested lists": "name: " + "[" * 3000 + "]" * 3000 + "\n",
        "nested mappings": "name: " + "{a: " * 3000 + "1" + "}" * 3000 + "\n",
        "nested blocks": "\n".join(" " * i + "a:" for i in range(1500)) + "\n",
        "a key twice": good + good,
        "a list as a key": "[1, 2]: x\n" + good,
        "a mapping as a key": "{a: b}: x\n" + good,
        "null as a key": "~: x\n" + good,
        "a number as a key": "1: x\n" + good,
        "a boolean as a key": "true: x\n" + good,
        "an empty key": "'': x\n" + good,
        "a key with a line break": '"x\\ny": 1\n' + good,
        "a long key": "k" * 900 + ": 1\n" + good,
        "20 000 keys": good + "".join(f"k{i}: 1\n" for i in range(20000)),
        "too large": "# " + "x" * 2_000_000 + "\n" + good,
        "two documents": good + "---\n" + good,
        "a list": "[1]",
        "a scalar": "x",
        "Latin-1": good.encode() + b"# \xe9\n",
        "UTF-16 without its mark": good.encode("utf-16-le"),
        "NUL": good.encode() + b"\0",
        "random bytes": random.Random(1).randbytes(3000),
        "tabs": "\ta: 1\n" + good,
        "a directive": "%YAML 9\n---\n" + good,
    }


def product_forms() -> Iterator[Case]:
    """Odd forms of a product file, odd names in it, and odd paths of meshes."""
    good = GOOD.decode()
    for name, text in forms(good).items():
        yield product(name, text, ("p.yaml",))
    for name in ("", "[/red]", "$x_{$", r"a\nb", r"a\e[31m", r"a\ud800", r"a\0", r"\u202ecod"):
        text = good.replace("  b:", f'  "{name}":').replace("[a, b]", f'[a, "{name}"]')
        codes = ANY if name in ("[/red]", "$x_{$") else (2,)
        yield product(
            f"a part called {name}", text.replace("hole: b", "hole: a"), ("p.yaml",), codes
        )
    paths = (
        "../a.obj", "x/../../a.obj", "/etc/passwd", "/dev/zero", ".", "..", "~", "C:\\\\x.stl",
        "http://127.0.0.1:9/x.obj", "file:///etc/passwd", "a.zip", "x" * 300 + ".obj",
        "x/" * 3000 + "a.obj", "folder.obj",
    )  # fmt: skip
    for path in paths:
        case = product(f"mesh {path[:30]}", good.replace("a.obj", f'"{path}"'), ("mesh", "'a'"))
        yield Case(case.name, case.arguments, {**case.files, "folder.obj": None}, case.culprits)
    odd = ("../motor", "../../etc/passwd", "motor.sdf", "hand_e/../motor", "x" * 300, "/x.sdf")
    for model in odd:
        yield product(
            f"model {model[:20]}", f'parts: {{a: {{model: "{model}"}}}}', ("model", "p.yaml")
        )
    for step in ("1e-9", "1e-5", "0.1"):
        text = good.replace("every_deg: 90", f"every_deg: {step}")
        yield product(f"turns by {step} degrees", text, ("every_deg",))
    for parts in (501, 6000):
        lines = "".join(f"  p{i}: {{mesh: none.obj, mass_kg: 1}}\n" for i in range(parts))
        yield product(f"{parts} parts without meshes", "parts:\n" + lines, ("p0",))


def product_edits() -> Iterator[Case]:
    """Bytes of a good product file changed, removed and added."""
    pieces = (
        b"[",
        b"{",
        b": ",
        b"- ",
        b"&a ",
        b"*a ",
        b"!!float ",
        b"\0",
        b"\n",
        b"'",
        b'"',
        b"<<: ",
    )
    draw = random.Random(7)
    for number in range(60):
        data = bytearray(GOOD)
        for _ in range(draw.randint(1, 6)):
            at = draw.randrange(len(data))
            what = draw.randrange(3)
            if what == 0:
                data[at] = draw.randrange(256)
            elif what == 1:
                del data[at : at + draw.randint(1, 8)]
            else:
                data[at:at] = draw.choice(pieces)
        yield product(f"edit {number}", bytes(data), ("p.yaml", "'a'", "'b'", "obj", "No "), ANY)


def settings(section=None, path: str = "") -> Iterator[str]:
    """Yield the path of every setting."""
    for key, value in _children(CellConfig() if section is None else section):
        if is_dataclass(value) or isinstance(value, Mapping):
            yield from settings(value, f"{path}{key}.")
        else:
            yield f"{path}{key}"


def _children(section):
    if isinstance(section, Mapping):
        return section.items()
    return ((info.name, getattr(section, info.name)) for info in fields(section))


def configurations() -> Iterator[Case]:
    """Odd values of settings, odd forms of configuration files, and odd overrides."""
    plan = ("plan", "p.yaml", *PLAN)
    files = {**BOXES, "p.yaml": GOOD}
    draw = random.Random(3)
    for path in draw.sample(list(settings()), 60):
        name, value = draw.choice(list(VALUES.items()))
        arguments = (*plan, "--set", f"{path}={value}")
        yield Case(f"{path}: {name}", arguments, files, (path,), ANY)
    for name, text in forms("simulation: {time_step: 0.001}\n").items():
        data = text.encode() if isinstance(text, str) else text
        arguments = (*plan, "--config", "c.yaml")
        yield Case(
            f"configuration: {name}", arguments, {**files, "c.yaml": data}, ("c.yaml", "key")
        )
    for text in (
        "", "=", "a", "a=", "=1", ".=1", "a..b=1", "simulation=1", "simulation.time_step",
        "simulation.time_step.x=1", "simulation.time_step=[", "simulation.time_step=&a",
        "simulation.time_step=*a", "simulation.time_step=" + "[" * 2000, "x" * 3000 + "=1",
        "simulation.time_step=\x1b[31m", "__class__=1", "simulation.__class__=1",
        "jig.bag.cell=1e-7", "jig.jammed.mesh_size=1e-9", "motion.max_iterations=1e30",
    ):  # fmt: skip
        culprits = ("--set", "key", text.partition("=")[0][:20])
        yield Case(f"--set {text[:40]!r}", (*plan, "--set", text), files, culprits)
    size = ("jig.bag.cap_radius=1", "jig.bag.cap_height=0.15", "jig.bag.cell=2e-4")
    overrides = tuple(word for one in size for word in ("--set", one))
    yield Case("a bag of 17 million cells", (*plan, *overrides), files, ("jig.bag.cell",))


def paths() -> Iterator[Case]:
    """Odd paths and arguments."""
    long, nul, loop = "x" * 300, "a\0b", "y/" * 3000
    odd = (
        "", " ", ".", "/", "..", long, loop + "z", nul, "/dev/zero", "/dev/null", "f/x", "[/red]",
        "a\nb", "a\x1b[31mb", "a\udcff", "~", "$HOME",
    )  # fmt: skip
    files = {**BOXES, "p.yaml": GOOD, "f": b"", "d": None, "n.yaml": None}
    for path in odd:
        shown = path[:20]
        for suffix in ("", ".yaml", ".step", ".stl"):
            if suffix and path in ("", " ", "/"):
                continue
            arguments = ("plan", path + suffix, *PLAN, "--units", "mm")
            # The line names the product by its path, or says which option is missing.
            codes = ANY if path + suffix == "." else (2,)
            yield Case(f"product {shown!r}{suffix}", arguments, files, ("",), codes)
        yield Case(f"--config {shown!r}", ("plan", "p.yaml", *PLAN, "--config", path), files, ("",))
        start = ("assemble", "--quiet", "--out", "out", "--start", path)
        yield Case(f"--start {shown!r}", start, files, ("",))
    for path in ("f", "f/x", "/dev/null", long, loop, nul, "/dev/full"):
        arguments = (*("plan", "p.yaml"), "--no-cache", "--no-html", "--quiet", "--out", path)
        yield Case(f"--out {path[:20]!r}", arguments, files, ("Cannot write",))
    for path in ("n.yaml", "d", "f"):
        yield Case(f"product {path}", ("plan", path, *PLAN, "--units", "mm"), files, (path,))
    for name in ("plan.json", "matrices.npz"):
        taken = {**files, f"out/{name}": None}
        yield Case(f"{name} is a folder", ("plan", "p.yaml", *PLAN), taken, (name,))
    for text in ("", ",", "a,,b", "a;b", "[/red]", "x" * 3000, "a\nb", "\x1b[31m", "a\0"):
        yield Case(
            f"--order {text[:9]!r}", ("plan", "p.yaml", *PLAN, "--order", text), files, ("",)
        )
    for text in ("x", "-1", "1.5", "", "1e3", "nan", "9" * 5000):
        yield Case(
            f"--seed {text[:9]!r}", ("plan", "p.yaml", *PLAN, "--seed", text), files, ("seed",)
        )
    for text in ("nan", "inf", "-1", "1e308", "1e-320", "x", ""):
        arguments = ("plan", "p.yaml", *PLAN, "--tolerance-mm", text)
        yield Case(f"--tolerance-mm {text!r}", arguments, files, ("tolerance-mm",))
    for command, option in (
        ("place", "--case"),
        ("push", "--case"),
        ("place", "--trials"),
        ("regress", "--suite"),
        ("sweep", "--grid"),
        ("sweep", "--sample"),
    ):
        for text in ("", "x", "[/red]", "\x1b[31m", "x" * 3000, "0", "-1", "nan", "9" * 30):
            experiment = ("assemble",) if command == "sweep" else ()
            arguments = (command, *experiment, "--out", "out", f"{option}={text}")
            yield Case(f"{command} {option} {text[:9]!r}", arguments, {}, ("",))


def names_and_surroundings() -> Iterator[Case]:
    """Names that mean something to terminals, pages and plots; odd environments."""
    good = GOOD.decode().replace(
        "joints: [{type: fit, shaft: a, hole: b, at_mm: [0, 0, 0], depth_mm: 5}]", ""
    )
    shown = ("plan", "p.yaml", "--no-cache", "--explain", "--out", "out")
    for name in (
        "[/red]", "[bold]x[/bold]", "$x_{$", "<script>alert(1)</script>", "</style><b>", "%s{0}",
        "a&b;", "部品", "\U0001f600", "'\\\"\\\\", "../../x", "a,b",
    ):  # fmt: skip
        text = good.replace("  b:", f'  "{name}":').replace("[a, b]", f'[a, "{name}"]')
        files = {**BOXES, "p.yaml": text.encode()}
        yield Case(f"a part called {name}", shown, files, ("p.yaml",), (0, 1))
    files = {**BOXES, "p.yaml": GOOD}
    for name, environment in (
        ("no HOME", {"HOME": None, "XDG_CACHE_HOME": None}),
        ("an empty HOME", {"HOME": "", "XDG_CACHE_HOME": None}),
        ("HOME that is not there", {"HOME": "/nowhere", "XDG_CACHE_HOME": None}),
        ("a cache that is a file", {"XDG_CACHE_HOME": "/dev/null"}),
        ("a cache with NUL-free nonsense", {"XDG_CACHE_HOME": "x" * 300}),
        ("a C locale", {"LC_ALL": "C", "LANG": "C"}),
        ("an unknown terminal", {"TERM": "nonsense", "COLUMNS": "-1"}),
        ("a width that is no number", {"COLUMNS": "many"}),
    ):
        arguments = ("plan", "p.yaml", "--no-html", "--out", "out")
        yield Case(name, arguments, files, ("",), (0,), environment)
    for arguments in (shown, ("plan", "p.yaml", *PLAN), ("--version",), ("--help",)):
        yield Case(f"{arguments[0]}, output closed", arguments, files, ("",), (0,), closed=True)


def in_product(name: str, file: str, data: bytes, codes: tuple[int, ...]) -> Case:
    """Return a case that plans a product with a mesh, or an assembly file by itself."""
    if file.endswith((".step", ".glb")):
        culprits = (file, f"'{file.partition('.')[0]}'", "Part '")
        return Case(name, ("plan", file, *PLAN), {file: data}, culprits, codes)
    text = GOOD.replace(b"mesh: a.obj", b"mesh: " + file.encode(), 1)
    return Case(
        name, ("plan", "p.yaml", *PLAN), {**BOXES, "p.yaml": text, file: data}, ("'a'",), codes
    )


def _of(cases: Callable[[], Iterator[tuple[str, str, bytes, tuple[int, ...]]]]):
    return lambda: (in_product(*case) for case in cases())


KINDS: dict[str, Callable[[], Iterator[Case]]] = {
    "values in products": product_values,
    "forms of products": product_forms,
    "edited products": product_edits,
    "configurations": configurations,
    "paths and arguments": paths,
    "names and surroundings": names_and_surroundings,
    "meshes": _of(mesh_cases),
    "glTF": _of(glb_cases),
    "STEP": _of(step_cases),
}
