"""What the candidates of a plan share in their evaluation: computed once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from cell.fixtures import fixture_class
from cell.fixtures.custom.fixture import CustomFixture, Design
from cell.products.product import Product
from cell.workpieces.work import fixture_work
from planning.feasibility.matrices import AssemblyMatrices
from planning.fixture_analysis.candidate import FixtureSetup, Judged
from planning.fixture_analysis.frozen_body import HeldPart, frozen_body
from planning.fixture_analysis.grip import GripAnalysis
from planning.fixture_analysis.held_body import HeldBody, seated_body
from planning.fixture_analysis.imprint import Imprint, PartSurface, press, samples_of
from planning.fixture_analysis.support import SupportAnalysis


class SharedAnalysis:
    """Caches what several candidates share.

    Attributes:
        judged: What the holding map was applied to, by the `Proposal.key`.
    """

    def __init__(self, product: Product, matrices: AssemblyMatrices, setup: FixtureSetup) -> None:
        self.product, self.matrices, self.setup = product, matrices, setup
        self.support = SupportAnalysis(product, matrices)
        self.grip = GripAnalysis(product, matrices.solids, setup.gripper_stroke)
        self._lows: dict[tuple[str, bytes], float] = {}
        self._samples: dict[str, PartSurface] = {}
        self._imprints: dict[tuple[tuple[str, ...], str, bytes], Imprint] = {}
        self._held_parts: dict[str, HeldPart] = {}
        self.judged: dict[tuple[tuple[str, ...], tuple[str, ...], str], Judged] = {}
        self._seated: dict[tuple[tuple[str, ...], str], tuple[HeldBody, Design]] = {}
        self._frozen: dict[tuple[tuple[str, ...], str, bytes], HeldBody] = {}

    def lowest(self, names: Sequence[str], R_JA: np.ndarray) -> float:
        """Return the height of the lowest point of parts, turned [m]."""
        key = R_JA.tobytes()
        for name in (name for name in names if (name, key) not in self._lows):
            vertices = self.matrices.solids[name].vertices
            self._lows[name, key] = float((vertices @ R_JA[2]).min())
        return min(self._lows[name, key] for name in names)

    def surface(self, name: str) -> PartSurface:
        """Return points on a part's surface."""
        if name not in self._samples:
            self._samples[name] = samples_of(self.matrices.solids[name])
        return self._samples[name]

    def imprint(
        self, body: Sequence[str], up: str, R_JA: np.ndarray, p_middle: np.ndarray
    ) -> Imprint:
        """Return the imprint of a body; parts far above the bed do not change it."""
        reach = self.lowest(body, R_JA) + self.setup.jig.bag.cap_height
        reaching = tuple(name for name in body if self.lowest((name,), R_JA) <= reach)
        key = reaching, up, p_middle.tobytes()
        if key not in self._imprints:
            parts = [self.surface(name) for name in reaching]
            force = self.setup.press_force
            self._imprints[key] = press(parts, R_JA, p_middle, self.setup.jig, force)
        return self._imprints[key]

    def frozen(
        self, body: Sequence[str], up: str, R_JA: np.ndarray, p_middle: np.ndarray
    ) -> HeldBody:
        """Return a body in the frozen bed; parts far above the bed do not touch it."""
        reach = self.lowest(body, R_JA) + self.setup.jig.bag.cap_height
        key = tuple(body), up, p_middle.tobytes()
        if key not in self._frozen:
            membrane, solids = self.setup.jig.jammed.friction, self.matrices.solids
            for name in (name for name in body if name not in self._held_parts):
                part = self.product.parts[name]
                self._held_parts[name] = HeldPart.of(part, solids[name], membrane)
            reaching = [n for n in body if self.lowest((n,), R_JA) <= reach]
            self._frozen[key] = frozen_body(
                [self._held_parts[name] for name in reaching],
                [solids[name] for name in body],
                R_JA,
                p_middle,
                self.setup.jig,
                self.setup.press_force,
            )
        return self._frozen[key]

    def seated(self, body: tuple[str, ...], up: str, R_JA: np.ndarray) -> tuple[HeldBody, Design]:
        """Return a body in the fixture that is made for its lowest part, and this fixture.

        Raises:
            FixtureError: It cannot be made for that part in this posture.
        """
        if (body, up) not in self._seated:
            assert self.setup.custom is not None
            part = min(body, key=lambda name: self.lowest((name,), R_JA))
            held = {"part": part, "up": up, "yaw_deg": 0.0}
            config = self.setup.custom.with_changes(
                {f"custom.held.{key}": value for key, value in held.items()}
            )
            work = fixture_work(config, self.product)
            assert work is not None
            kind = cast(type[CustomFixture], fixture_class(config.workcell.fixture))
            design, solids = kind.design(work), [self.matrices.solids[name] for name in body]
            X_AP = self.product.parts[part].X_AP
            self._seated[body, up] = seated_body(design, work, solids, X_AP), design
        return self._seated[body, up]
