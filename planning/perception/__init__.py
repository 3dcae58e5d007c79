"""From what is seen to a belief: where the parts are, as far as the planner knows."""
