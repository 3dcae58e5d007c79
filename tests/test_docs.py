"""The documentation leads somewhere: `make docs` checks the links of the pages, this the others."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"\]\((?!https?:)([^)#\s]+)")


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_links_to_files_exist(name: str) -> None:
    for target in LINK.findall((ROOT / name).read_text()):
        assert (ROOT / target).exists(), target


def test_every_page_is_in_the_navigation() -> None:
    listed = (ROOT / "mkdocs.yml").read_text()
    for page in (ROOT / "docs").rglob("*.md"):
        assert f": {page.relative_to(ROOT / 'docs').as_posix()}" in listed


def test_every_tutorial_is_on_a_page() -> None:
    pages = "".join(page.read_text() for page in (ROOT / "docs" / "guide").glob("*.md"))
    for script in (ROOT / "docs" / "tutorials").glob("*.py"):
        assert f"docs/tutorials/{script.name}" in pages


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) < 100
