"""The SDF models that a product file names: beside the file, or of the package.

A name stands for ``models/<name>/<name>.sdf`` beside the product file, or else for a model of the
package; a path that ends in ``.sdf`` is relative to the product file. What a user's file refers to
lies in its folder, so that a product from somebody else reads nothing else of the user's machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from cell.errors import InputError, UnknownName
from cell.paths import FILE_URL, MODELS, is_file, model_folder, model_names, package_above

OWN_MODELS = "models"
"""Folder of a user's models, beside their product file."""


@dataclass(frozen=True)
class ModelFile:
    """A model that a product file names.

    Attributes:
        model: The name of a model of the package, or the URL of a user's: see `cell.paths`.
        sdf: The file.
    """

    model: str
    sdf: Path

    @property
    def mesh(self) -> Path:
        """The closed surface that is planned with, beside the SDF."""
        return self.sdf.with_suffix(".obj")

    def mass(self) -> float:
        """Return the mass of its bodies [kg].

        Raises:
            InputError: It is no SDF, or states none.
        """
        masses = [element.text for element in _root(self.sdf).iter("mass")]
        try:
            total = sum(float(text or "") for text in masses)
        except ValueError:
            raise InputError(f"'{self.sdf}': a mass is a number, in {masses}.") from None
        if not total > 0.0:
            raise InputError(f"'{self.sdf}' states no mass.")
        return total


def find_model(name: str, product: Path, *, outside: bool = False) -> ModelFile:
    """Return the model that a product file names.

    Args:
        name: As the file states it.
        product: The product file.
        outside: Whether models may lie, and refer to files, outside of the product's folder.

    Raises:
        UnknownName: There is no such model.
        InputError: It is outside of the folder, or refers to what is, or to what is missing.
    """
    folder = product.parent.resolve()
    if name.endswith(".sdf"):
        sdf = folder / name
        if not is_file(sdf):
            raise InputError(f"{product.name}: no model file '{sdf}'.")
    else:
        sdf = folder / OWN_MODELS / name / f"{name}.sdf"
        if not is_file(sdf):
            return _of_package(name, folder)
    _require_inside(sdf, folder, outside, product.name)
    for element in _root(sdf).iter("uri"):
        referred = _referred(element.text or "", sdf)
        if referred is None:
            continue
        if not is_file(referred):
            raise InputError(f"'{sdf}': its mesh '{element.text}' is missing.")
        _require_inside(referred, folder, outside, sdf.name)
    return ModelFile(f"{FILE_URL}{sdf.resolve()}", sdf.resolve())


def _of_package(name: str, folder: Path) -> ModelFile:
    if name not in model_names():
        own = sorted(file.stem for file in (folder / OWN_MODELS).glob("*/*.sdf"))
        raise UnknownName("model", name, [*own, *model_names()])
    return ModelFile(name, model_folder(name) / f"{name}.sdf")


def _root(sdf: Path) -> ElementTree.Element:
    try:
        return ElementTree.parse(sdf).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"'{sdf}' is not a readable SDF: {error}.") from error


def _referred(uri: str, sdf: Path) -> Path | None:
    """Return the file that a URI in an SDF stands for; None for one of the package."""
    scheme, _, rest = uri.strip().rpartition("://")
    if scheme == "file":
        return Path(rest)
    if scheme != "package":
        return sdf.parent / rest
    package, _, path = rest.partition("/")
    xml = package_above(sdf)
    if xml is not None and xml.parent != MODELS and _root(xml).findtext("name") == package:
        return xml.parent / path
    if package == _root(MODELS / "package.xml").findtext("name"):
        return None
    raise InputError(
        f"'{sdf}': no package '{package}'; a package.xml above the file with this name makes one."
    )


def _require_inside(file: Path, folder: Path, outside: bool, where: str) -> None:
    if not outside and not file.resolve().is_relative_to(folder):
        raise InputError(
            f"{where}: '{file}' is outside of the product's folder '{folder}'; "
            "--allow-outside lets a product use such files."
        )
