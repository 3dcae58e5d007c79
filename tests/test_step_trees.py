"""Names and trees of STEP files: as their authors gave them, whatever the exporter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from step_files import SOLIDS, StepFile, StepTree
from tiny_products import box

from cell.errors import BadPart, InputError, UnknownName
from cell.products.loading import load_product
from cell.products.product import LeftOut, Product
from cell.products.read_options import ReadOptions
from cell.products.step_text import StepText, decoded
from cell.products.tree import Node, authored, distinct

CUBE, SLAB = box((10, 10, 10), (0, 0, 0)), box((40, 20, 5), (0, 0, -5))


def load(folder: Path, file: StepFile, name: str = "file.step", **options) -> Product:
    (folder / name).write_text(file.text())
    return load_product(folder / name, ReadOptions(**options))


def clamps(name: str = "clamp") -> StepTree:
    """Two clamps, each of a plate and two pins."""
    file = StepTree()
    plate, pin = file.part("plate", SLAB), file.part("pin", CUBE)
    clamp = file.assembly(name, ("", plate, (0, 0, 0)), ("", pin, (0, 0, 0)), ("", pin, (20, 0, 0)))
    file.assembly("root", ("", clamp, (0, 0, 0)), ("", clamp, (0, 50, 0)))
    return file


NAMES = [
    # Instance, product, and the right name of two such instances.
    ("", "pin", "pin_1 pin_2"),
    (" ", "pin", "pin_1 pin_2"),  # SolidWorks
    ("NAUO12", "pin", "pin_1 pin_2"),
    ("Next assembly relationship", "pin", "pin_1 pin_2"),  # Creo
    ("=>[0:1:1:2]", "pin", "pin_1 pin_2"),  # OpenCASCADE
    ("=>[0:1:1:2]", "SOLID", "part_1 part_2"),
    ("", "Open CASCADE STEP translator 7.8 1", "part_1 part_2"),
    ("0_1_1_3__1", "COMPOUND", "part_1 part_2"),
    ("7", "8", "part_1 part_2"),
    ("5e6ae59f-9c0e-4b2a-8f7a-0123456789ab", "", "part_1 part_2"),  # CadQuery
    ("left pin", "pin", "left_pin_1 left_pin_2"),
    ("Pin, 4x20 / DIN 7", "pin", "Pin_4x20_DIN_7_1 Pin_4x20_DIN_7_2"),
    ("pin <1>", "pin", "pin_<1>_1 pin_<1>_2"),
    (r"\X2\5E95677F\X0\ \X2\00F8\X0\6", "pin", "底板_ø6_1 底板_ø6_2"),
]


@pytest.mark.parametrize(("given", "product", "right"), NAMES)
def test_names_are_those_that_the_author_gave(given, product, right, tmp_path) -> None:
    file = StepTree()
    pin, plate = file.part(product, CUBE), file.part("plate", SLAB)
    places = [(given, pin, (0, 0, 0)), (given, pin, (20, 0, 0)), ("", plate, (0, 0, 0))]
    file.assembly("root", *places)
    assert set(load(tmp_path, file).parts) == {"plate", *right.split()}


def test_a_name_that_one_instance_has_for_itself_stays(tmp_path: Path) -> None:
    """Numbers are for those that are named after their product."""
    file = StepTree()
    pin = file.part("pin", CUBE)
    names = ["", "pin", "", "pin:1", "pin_3", "long"]
    file.assembly("root", *((name, pin, (20.0 * k, 0, 0)) for k, name in enumerate(names)))
    product = load(tmp_path, file)
    assert list(product.parts) == ["long", "pin", "pin:1", "pin_2", "pin_3", "pin_4"]
    places = {name: round(1e3 * part.mesh.bounds[0][0]) for name, part in product.parts.items()}
    assert places == {"pin_2": 0, "pin": 20, "pin_4": 40, "pin:1": 60, "pin_3": 80, "long": 100}


def test_names_of_siblings_are_always_distinct() -> None:
    rng = np.random.default_rng(0)
    known = ["", "a", "a_1", "a_2", "part", "part_1"]
    for _ in range(200):
        siblings = [Node(*rng.choice(known, 2)) for _ in range(6)]
        names = distinct(siblings)
        assert len(set(names)) == 6 and all(names)
        for node, name in zip(siblings, names, strict=True):
            assert name.startswith(node.name or "part")


def test_sub_assemblies_are_kept_in_the_names(tmp_path: Path) -> None:
    product = load(tmp_path, clamps())
    inside = ("pin_1", "pin_2", "plate")
    assert list(product.parts) == [f"clamp_{k}/{name}" for k in (1, 2) for name in inside]
    assert product.groups == {}
    tree = "sub-assemblies: clamp_1 (3 parts), clamp_2 (3 parts); --depth 1 makes one item of each"
    assert tree in product.notes


def test_a_sub_assembly_without_a_name_of_its_own_has_its_products(tmp_path: Path) -> None:
    """OpenCASCADE forgets the product of a sub-assembly: it is read from the file."""
    assert "clamp_2/pin_1" in load(tmp_path, clamps()).parts
    assert "part_2/pin_1" in load(tmp_path, clamps("ASSEMBLY")).parts


def test_depth_makes_one_item_of_a_sub_assembly(tmp_path: Path) -> None:
    file = StepTree()
    pin, plate = file.part("pin", CUBE), file.part("plate", SLAB)
    inner = file.assembly("inner", ("", pin, (0, 0, 0)), ("", pin, (20, 0, 0)))
    outer = file.assembly("outer", ("", inner, (0, 0, 0)), ("", plate, (0, 0, 0)))
    file.assembly("root", ("", outer, (0, 0, 0)), ("", plate, (0, 90, 0)))
    members = ("outer/inner/pin_1", "outer/inner/pin_2", "outer/plate")
    assert load(tmp_path, file, depth=1).groups == {"outer": members}
    assert load(tmp_path, file, depth=1).items() == ("outer", "plate")
    assert load(tmp_path, file, depth=2).groups == {"outer/inner": members[:2]}
    assert load(tmp_path, file, depth=2).items() == ("outer/inner", "outer/plate", "plate")
    with pytest.raises(InputError, match="--depth 3 .*: the deepest sub-assembly is at level 2"):
        load(tmp_path, file, depth=3)
    with pytest.raises(InputError, match="1 or more"):
        load(tmp_path, file, depth=0)


def test_levels_that_tell_nothing_apart_are_dropped(tmp_path: Path) -> None:
    """CadQuery and FreeCAD put every part into an assembly of its own, and all into another."""
    file = StepTree()
    pin, plate = file.part("pin_part", CUBE), file.part("Body", SLAB)
    boxed = [file.assembly(n, ("", p, (0, 0, 0))) for n, p in (("pin", pin), ("plate", plate))]
    whole = file.assembly("whole", *(("", one, (0, 0, 0)) for one in boxed))
    file.assembly("root", ("", whole, (0, 0, 0)))
    assert list(load(tmp_path, file).parts) == ["pin", "plate"]


def test_a_single_part_without_a_name_has_that_of_its_file(tmp_path: Path) -> None:
    file = StepTree()
    file.part("Open CASCADE STEP translator 7.8 1", CUBE)
    assert list(load(tmp_path, file, "bracket.stp").parts) == ["bracket"]


@pytest.mark.parametrize(
    ("name", "page"),
    [("底板", "gb2312"), ("ピン", "cp932"), ("Gehäuse", "latin-1"), ("底ø", "utf-8")],
)
def test_names_in_code_pages_are_read(name: str, page: str, tmp_path: Path) -> None:
    """SolidWorks writes the code page of its system where the standard has directives."""
    file = StepTree()
    file.assembly(
        "root", ("", file.part("NAME", CUBE), (0, 0, 0)), ("", file.part("b", SLAB), (0, 0, 0))
    )
    (tmp_path / "file.p21").write_bytes(file.text().replace("NAME", name).encode(page))
    assert name in load_product(tmp_path / "file.p21").parts


@pytest.mark.parametrize(
    ("raw", "text"),
    [
        ("'plain'", "plain"),
        ("'it''s'", "it's"),
        (r"'\X2\00F8\X0\6'", "ø6"),
        (r"'\X4\0001F600\X0\'", "😀"),
        (r"'\X\E4'", "ä"),
        (r"'\S\d'", "ä"),
        (r"'a\\b'", "a\\b"),
        ("$", ""),
    ],
)
def test_strings_are_decoded(raw: str, text: str) -> None:
    assert decoded(raw.encode()) == text


def test_text_is_read_over_line_breaks_and_odd_names() -> None:
    """Parentheses, commas, quotes and comments in or between the arguments."""
    text = StepText(
        b"#1 = PRODUCT( 'a),''#9', /* , */ 'pin (2, left)','',(#9));\n"
        b"#2=PRODUCT_DEFINITION_FORMATION_WITH_SPECIFIED_SOURCE('','',\n #1 , .MADE.);"
        b"#3=PRODUCT_DEFINITION('design','',#2,#8);#4=PRODUCT('b','','',(#9));"
        b"#5=PRODUCT_DEFINITION_FORMATION('','',#4);#6=PRODUCT_DEFINITION('','',#5,#8);"
        b"#7=NEXT_ASSEMBLY_USAGE_OCCURRENCE('1',\n'x,y','',#6,#3,$);"
    )
    assert text.products == {3: "pin (2, left)", 6: "b"} and text.roots == [6]
    usage = text.usages[7]
    assert (usage.given, usage.product, usage.parent, usage.child) == ("x,y", "pin (2, left)", 6, 3)
    assert b"('1',\n'#7','',#6" in text.with_keys()


def test_made_up_names_are_known() -> None:
    for name in ("COMPOUND_1", "Solid3", "NAUO1", "0:1:1:2", "node_3", "Mesh.002", "unnamed", ""):
        assert authored(name) == "", name
    for name in ("solid pin", "Part1", "M3x10", "mesh plate", "compound lever", "1st", "10x20"):
        assert authored(name) == name.replace(" ", "_"), name


def test_parts_without_a_solid_are_named(tmp_path: Path) -> None:
    """A surface, and a product with no shape at all."""
    file = StepTree()
    label = file.product("label", "SHAPE_REPRESENTATION", [file.world(), file.sheet(CUBE)])
    things = [("", file.part("pin", CUBE), (0.0, 0, 0)), ("", file.part("sketch"), (0.0, 0, 0))]
    file.assembly("root", *things, ("", label, (30, 0, 0)), ("", file.part("b", SLAB), (0, 0, 0)))
    product = load(tmp_path, file)
    assert list(product.parts) == ["b", "pin"]
    sketch, sheet = sorted(product.left_out, key=lambda thing: thing.name, reverse=True)
    assert sketch == LeftOut("sketch", "empty")
    assert sheet.name == "label" and sheet.reason.startswith("not watertight: 3 open edges, one of")
    assert any(note.startswith("left out: label (not watertight") for note in product.notes)
    alone = StepTree()
    alone.product("label", "SHAPE_REPRESENTATION", [alone.world(), alone.sheet(CUBE)])
    with pytest.raises(BadPart, match="'label': it is no solid: not watertight"):
        load(tmp_path, alone)


def test_any_part_or_sub_assembly_is_left_out_by_name(tmp_path: Path) -> None:
    product = load(tmp_path, clamps(), leave_out=("clamp_1", "clamp_2/pin_2"))
    assert list(product.parts) == ["clamp_2/pin_1", "clamp_2/plate"]
    assert {thing.name for thing in product.left_out} == {"clamp_1", "clamp_2/pin_2"}
    assert "left out: clamp_1, clamp_2/pin_2 (by --leave-out)" in product.notes
    with pytest.raises(UnknownName, match="No part or sub-assembly 'clamp'.*mean 'clamp_"):
        load(tmp_path, clamps(), leave_out=("clamp",))
    with pytest.raises(InputError, match="holds no solid"):
        load(tmp_path, clamps(), leave_out=("clamp_1", "clamp_2"))


def test_solids_of_a_product_are_one_part_or_several(tmp_path: Path) -> None:
    file = StepTree()
    feet = file.part("feet", *(CUBE.translate([x, 0, 0]) for x in (0, 10, 30)))
    file.assembly("root", ("", feet, (0, 0, 0)), ("", feet, (0, 50, 0)))
    product = load(tmp_path, file)
    assert list(product.parts) == ["feet_1", "feet_2"]
    note = "feet_1, feet_2 each hold 3 bodies, of which some touch; --split makes them parts"
    assert note in product.notes
    parts = load(tmp_path, file, split=True).parts
    assert list(parts) == [f"feet_{k}_{body}" for k in (1, 2) for body in (1, 2, 3)]
    assert parts["feet_2_3"].mesh.bounds[0] == pytest.approx([30e-3, 50e-3, 0], abs=1e-8)


def test_an_assembly_may_have_a_solid_of_its_own(tmp_path: Path) -> None:
    file = StepTree()
    pin, place = file.part("pin", CUBE), file.world((20, 0, 0))
    host = file.product("host", SOLIDS, [file.world(), file.solid(SLAB), place])
    file.instance("", host, pin, (file.world(), place))
    assert list(load(tmp_path, file).parts) == ["host", "pin"]
    file.assembly("top", ("", host, (0, 0, 0)), ("", host, (0, 50, 0)))
    parts = load(tmp_path, file).parts
    assert list(parts) == ["host_1/host", "host_1/pin", "host_2/host", "host_2/pin"]


def test_an_instance_that_is_placed_nowhere_is_named(tmp_path: Path) -> None:
    file = StepTree()
    pin, base = file.part("pin", CUBE), file.part("base", SLAB)
    whole = file.assembly("whole", ("", base, (0, 0, 0)))
    file.add(f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('1','lost one','',{whole[0]},{pin[0]},$)")
    product = load(tmp_path, file)
    assert list(product.parts) == ["base"]
    assert product.left_out == (LeftOut("lost_one", "no shape in the file"),)


def test_products_outside_of_any_assembly_are_parts(tmp_path: Path) -> None:
    file = StepTree()
    file.part("one", CUBE)
    file.part("two", SLAB)
    assert list(load(tmp_path, file).parts) == ["one", "two"]
