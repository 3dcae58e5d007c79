"""Evaluator of the candidates of a plan, on whichever fixture the cell has."""

from __future__ import annotations

from planning.fixture_analysis.candidate import Candidate, Proposal
from planning.fixture_analysis.evaluate import Evaluation, Rejected
from planning.fixture_analysis.evaluate_custom import CustomEvaluation
from planning.fixture_analysis.shared_analysis import SharedAnalysis


class Evaluator(SharedAnalysis):
    """Evaluates candidates, one by one."""

    def evaluate(self, proposal: Proposal, *, mapped: bool = False) -> Candidate:
        """Run the tests and return the candidate with figures, and scores or the reason.

        Args:
            proposal: What is to be held, and how.
            mapped: Whether the holding map says what the body bears, not the formula.
        """
        kind = Evaluation if self.setup.custom is None else CustomEvaluation
        evaluation = kind(self, proposal, mapped)
        scores: dict[str, float] = {}
        rejected = ""
        try:
            scores = evaluation.scores()
        except Rejected as reason:
            rejected = str(reason)
        return Candidate(
            proposal.name,
            proposal.body,
            proposal.moved,
            proposal.up,
            proposal.approach,
            evaluation.figures,
            scores,
            rejected,
            tuple(evaluation.notes),
        )
