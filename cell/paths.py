"""Where models are: those of the package, and those beside a product file of a user's own."""

from __future__ import annotations

from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from cell.errors import InputError, UnknownName

MODELS = Path(__file__).resolve().parent.parent / "models"
FILE_URL = "file://"


def new_parser(plant: MultibodyPlant, model: str = "") -> Parser:
    """Return a parser that resolves ``package://soft_jig_models/...`` and renames duplicates.

    Args:
        plant: Not finalized yet.
        model: What is to be parsed, as `model_url` takes it: a file may refer to the package that
            it lies in, which is that of the nearest ``package.xml`` above it.
    """
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(MODELS / "package.xml"))
    if model.startswith(FILE_URL):
        own = package_above(Path(model.removeprefix(FILE_URL)))
        if own is not None and own != MODELS / "package.xml":
            parser.package_map().AddPackageXml(str(own))
    parser.SetAutoRenaming(True)
    return parser


def package_above(file: Path) -> Path | None:
    """Return the nearest ``package.xml`` in the folders above a file; None if there is none."""
    found = (folder / "package.xml" for folder in file.resolve().parents)
    return next((candidate for candidate in found if candidate.is_file()), None)


def possible_path(path: str | Path) -> Path:
    """Return a path, whether or not there is anything.

    Raises:
        InputError: Nothing can be there: it is empty, too long, a loop of links, or holds a NUL.
    """
    try:
        Path(path).stat()
        reason = ""
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        reason = ""
    except OSError as error:
        reason = error.strerror or str(error)
    except ValueError as error:
        reason = str(error)
    if reason or not str(path).strip():
        raise InputError(f"'{path}' is no path of a file: {reason or 'it is empty'}.")
    return Path(path)


def is_file(path: Path) -> bool:
    """Return whether a path is a file; one that no file can have, too long or with NUL, is not."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def model_url(name: str) -> str:
    """Return the URL of ``models/sdf/<name>/<name>.sdf``; a URL is returned as it is.

    A model of a user's own lies anywhere: ``file:///home/me/my_arm.sdf``.
    """
    return name if "://" in name else f"package://soft_jig_models/sdf/{name}/{name}.sdf"


def model_names() -> list[str]:
    """Return the names of the models of the package."""
    return sorted(file.stem for file in (MODELS / "sdf").glob("*/*.sdf"))


def model_folder(name: str) -> Path:
    """Return the folder of an SDF model of the package: ``models/sdf/<name>``.

    Raises:
        UnknownName: There is no such model.
    """
    if name not in model_names():
        raise UnknownName("model", name, model_names())
    return MODELS / "sdf" / name
