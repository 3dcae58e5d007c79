"""Bad input is refused where it is read: limits, paths, folders of others, sizes, plots."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from hostile_input import BOXES, GOOD
from matplotlib.figure import Figure

import cell.products.assembly_io as assembly_io
from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.fixtures.soft_jig.parameters import BadJig
from cell.paths import is_file, possible_path
from cell.products.loading import load_product
from cell.products.read_options import ReadOptions
from experiments.assembly.replay import Replay
from experiments.reporting.plots import figure_png
from planning.feasibility.cache import load_matrices, save_matrices, user_cache
from planning.feasibility.matrices import matrices_of


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "crashes .SIGSEGV"),
        ("while True: pass", "takes longer than 1 s"),
        ("x = bytearray(1 << 40)", "takes more than"),
        ("raise SystemExit('no such thing')", "no such thing"),
    ],
)
def test_whatever_the_reader_of_step_does_is_one_line(
    script: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The converter begins as it does, within its limits, and then does something else."""
    text = assembly_io.CONVERTER.read_text(encoding="utf-8")
    assert text.count("    import cascadio") == 1
    converter = tmp_path / "converter.py"
    converter.write_text(text.replace("    import cascadio", f"    {script}\n    import cascadio"))
    monkeypatch.setattr(assembly_io, "CONVERTER", converter)
    monkeypatch.setattr(assembly_io, "CPU_SECONDS", 1)
    file = tmp_path / "part.step"
    file.write_text("ISO-10303-21;")
    with pytest.raises(InputError, match=message) as caught:
        load_product(file)
    assert "part.step" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("path", ["../a.obj", "x/../../a.obj", "/etc/a.obj", "..\\\\a.obj"])
def test_meshes_outside_of_the_folder_need_leave(path: str, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "a.obj").write_bytes(BOXES["a.obj"])
    (tmp_path / "in" / "b.obj").write_bytes(BOXES["b.obj"])
    file = tmp_path / "in" / "p.yaml"
    file.write_bytes(GOOD.replace(b"a.obj", f'"{path}"'.encode()))
    with pytest.raises(
        InputError, match="parts.a.mesh: .* not in the product's folder .--allow-outside"
    ):
        load_product(file)
    if path == "../a.obj":
        assert list(load_product(file, ReadOptions(outside=True)).parts) == ["a", "b"]


def test_a_path_inside_may_go_down_and_up_again(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    for name, data in BOXES.items():
        (tmp_path / name).write_bytes(data)
    file = tmp_path / "p.yaml"
    file.write_bytes(GOOD.replace(b"a.obj", b"x/../a.obj"))
    assert list(load_product(file).parts) == ["a", "b"]


@pytest.mark.parametrize("path", ["", " ", "x" * 300, "y/" * 3000, "a\0b"])
def test_paths_that_cannot_be(path: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no path of a file: "):
        possible_path(path)
    assert not is_file(Path(path))
    assert possible_path(tmp_path / "nothing" / "here") == tmp_path / "nothing" / "here"


def test_a_bag_that_does_not_fit_into_memory() -> None:
    wide = {"jig.bag.cap_radius": 1.0, "jig.bag.cap_height": 0.15}
    assert CellConfig.load(overrides=wide | {"jig.bag.cell": 2e-3}).jig.bag.cell == 2e-3
    with pytest.raises(BadJig, match=r"2\.8e\+07 cells of 0.0002 m \(jig.bag.cell\)"):
        CellConfig.load(overrides=wide | {"jig.bag.cell": 2e-4})
    with pytest.raises(BadJig, match=r"\(jig.jammed.mesh_size\)"):
        CellConfig.load(overrides=wide | {"jig.bag.cell": 5e-3, "jig.jammed.mesh_size": 1e-3})


def test_a_dollar_sign_in_a_plot_is_a_dollar_sign() -> None:
    figure = Figure()
    figure.add_subplot().set_title("part $x_{$")
    assert figure_png(figure).startswith(b"\x89PNG")


def test_the_view_listens_on_this_machine_only() -> None:
    replay = Replay(view=True, file=None)
    assert replay.url is not None and replay.url.startswith("http://localhost:")


def test_a_user_without_a_home_has_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    assert user_cache() is None


def test_damaged_cache_entries_count_as_absent(tmp_path: Path) -> None:
    """Cut off, bytes changed: what is read is what was written, or nothing."""
    for name, data in BOXES.items():
        (tmp_path / name).write_bytes(data)
    product_file = tmp_path / "p.yaml"
    product_file.write_bytes(GOOD)
    matrices = matrices_of(load_product(product_file), None)
    entry = tmp_path / "entry.npz"
    save_matrices(matrices, entry)
    good, draw, absent = entry.read_bytes(), random.Random(0), 0
    for number in range(150):
        damaged = bytearray(good)
        if number < 50:
            del damaged[draw.randrange(len(good)) :]
        else:
            for _ in range(draw.randint(1, 4)):
                damaged[draw.randrange(len(good))] = draw.randrange(256)
        entry.write_bytes(damaged)
        found = load_matrices(entry, matrices.solids)
        absent += found is None
        if found is not None:
            np.testing.assert_array_equal(found.contact, matrices.contact)
            np.testing.assert_array_equal(found.contact_margin, matrices.contact_margin)
            for j, free in matrices.interference.free.items():
                np.testing.assert_array_equal(found.interference.free[j], free)
    assert absent > 100
