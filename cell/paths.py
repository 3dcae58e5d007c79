"""Where the models are, from a source tree and from an installed wheel alike."""

from __future__ import annotations

from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

MODELS = Path(__file__).resolve().parent.parent / "models"


def new_parser(plant: MultibodyPlant) -> Parser:
    """Return a parser that resolves ``package://soft_jig_models/...`` and renames duplicates."""
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(MODELS / "package.xml"))
    parser.SetAutoRenaming(True)
    return parser


def model_url(name: str) -> str:
    """Return the URL of ``models/sdf/<name>/<name>.sdf``."""
    return f"package://soft_jig_models/sdf/{name}/{name}.sdf"
