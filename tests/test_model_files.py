"""A product of a user's own lies anywhere: its models and its tray are found beside it."""

from pathlib import Path

import pytest
import yaml
from pydrake.multibody.plant import MultibodyPlant

from cell.cad import motor_unit as mu
from cell.cad.sdf import Contact, Model, Piece, mesh_inertia, write_model
from cell.cad.shapes import box
from cell.errors import InputError, UnknownName
from cell.paths import model_url, new_parser
from cell.products.loading import load_product
from cell.products.read_options import ReadOptions


def write_block(folder: Path, name: str = "block") -> Path:
    """Write the model of an aluminium block of 20 mm; return its SDF."""
    whole = mu.mesh(box((-10, -10, 0), (10, 10, 20)))
    pieces = [Piece("bed_body", whole, Contact(0.5), convex=True)]
    inertia = mesh_inertia(whole, mu.ALUMINIUM * whole.volume)
    return write_model(folder, Model(name, inertia, pieces, [], whole), "a test")


def write_product(folder: Path, model: str, **more: object) -> Path:
    """Write a product file with one part."""
    part = {"model": model, "tray_pose": {"xyz_mm": [0, 0, 30]}}
    file = folder / "product.yaml"
    file.write_text(yaml.safe_dump({"parts": {"block": part}, **more}))
    return file


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A folder with a space in its name, which URLs must survive."""
    folder = tmp_path / "my product"
    folder.mkdir()
    return folder


@pytest.mark.parametrize("model", ["block", "models/block/block.sdf"])
def test_models_and_tray_are_found_beside_the_product_file(home: Path, model: str) -> None:
    write_block(home / "models")
    write_block(home / "models", "tray")
    product = load_product(write_product(home, model, tray="tray"))
    part = product.parts["block"]
    assert part.mass == pytest.approx(mu.ALUMINIUM * 8e-6)
    for url in (part.model, product.tray):
        plant = MultibodyPlant(1e-3)
        assert url is not None
        new_parser(plant, url).AddModelsFromUrl(model_url(url))
        assert plant.num_bodies() == 2


def test_a_model_may_refer_to_the_package_it_lies_in(home: Path) -> None:
    sdf = write_block(home / "models")
    (home / "package.xml").write_text("<package><name>mine</name></package>")
    text = sdf.read_text().replace("<uri>", "<uri>package://mine/models/block/")
    sdf.write_text(text)
    model = load_product(write_product(home, "block")).parts["block"].model
    assert model is not None
    plant = MultibodyPlant(1e-3)
    new_parser(plant, model).AddModelsFromUrl(model)
    assert plant.num_bodies() == 2


def test_models_of_the_package_are_still_found_by_name(home: Path) -> None:
    assert load_product(write_product(home, "motor")).parts["block"].model == "motor"
    with pytest.raises(UnknownName, match="moter"):
        load_product(write_product(home, "moter"))


def test_models_outside_of_the_folder_are_refused_unless_allowed(home: Path) -> None:
    write_block(home.parent / "elsewhere")
    file = write_product(home, "../elsewhere/block/block.sdf")
    with pytest.raises(InputError, match="outside of the product's folder.*--allow-outside"):
        load_product(file)
    assert load_product(file, ReadOptions(outside=True)).parts["block"].mass > 0.0


def test_a_model_that_reads_files_outside_is_refused_too(home: Path) -> None:
    sdf = write_block(home / "models")
    (home.parent / "other.obj").write_text(sdf.with_suffix(".obj").read_text())
    sdf.write_text(sdf.read_text().replace("<uri>", "<uri>../../../other.obj</uri><uri>"))
    with pytest.raises(InputError, match="outside of the product's folder"):
        load_product(write_product(home, "block"))


def test_a_missing_mesh_or_package_is_named(home: Path) -> None:
    sdf = write_block(home / "models")
    whole = sdf.read_text()
    for wrong, said in (("none/", "is missing"), ("package://nobody/", "no package 'nobody'")):
        sdf.write_text(whole.replace("<uri>", f"<uri>{wrong}"))
        with pytest.raises(InputError, match=said):
            load_product(write_product(home, "block"))
