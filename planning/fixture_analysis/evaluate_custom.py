"""Evaluation of one candidate on a fixture that is made for a part: nest, or posts."""

from __future__ import annotations

import numpy as np

from cell.fixtures import FixtureError
from cell.fixtures.custom.work import MM
from planning.fixture_analysis.evaluate import Evaluation, Rejected
from planning.fixture_analysis.footprint import footprint


class CustomEvaluation(Evaluation):
    """As on the soft jig, without what is about its bag; the holding map always judges."""

    def scores(self) -> dict[str, float]:
        """Return the scores, filling in figures and notes.

        Raises:
            Rejected: A test fails.
        """
        self.mapped = True
        self._check_approach()
        self._check_connected()
        width = self._grip_width()
        self._check_balance()
        try:
            held, design = self.shared.seated(self.proposal.body, self.proposal.up, self.R_JA)
        except FixtureError as error:
            raise Rejected(str(error).rstrip(".")) from error
        pads = design.supports[:, :2] / MM
        tilt = self._tilt(footprint(pads), held.p_JA[:2])
        margin = self._holding_margin(self._margin_on(held))
        return {
            "reach": (1.0 + max(0.0, self.proposal.rise)) / 2.0,
            "stability": tilt / (np.pi / 2),
            "holding": margin / (1.0 + margin),
            "gripper": max(0.0, 1.0 - width / self.setup.gripper_stroke),
            "continuity": float(self.proposal.held or self.proposal.empty),
        }
