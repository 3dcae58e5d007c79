"""Where the models are, from a source tree and from an installed wheel alike."""

from __future__ import annotations

from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from cell.errors import UnknownName

MODELS = Path(__file__).resolve().parent.parent / "models"


def new_parser(plant: MultibodyPlant) -> Parser:
    """Return a parser that resolves ``package://soft_jig_models/...`` and renames duplicates."""
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(MODELS / "package.xml"))
    parser.SetAutoRenaming(True)
    return parser


def model_url(name: str) -> str:
    """Return the URL of ``models/sdf/<name>/<name>.sdf``; a URL is returned as it is.

    A model of a user's own lies anywhere: ``file:///home/me/my_arm.sdf``.
    """
    return name if "://" in name else f"package://soft_jig_models/sdf/{name}/{name}.sdf"


def model_folder(name: str) -> Path:
    """Return the folder of an SDF model that a product names: ``models/sdf/<name>``.

    Raises:
        UnknownName: There is no such model.
    """
    known = [file.stem for file in (MODELS / "sdf").glob("*/*.sdf")]
    if name not in known:
        raise UnknownName("model", name, known)
    return MODELS / "sdf" / name
