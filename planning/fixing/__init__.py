"""Which part is fixed on the jig in which posture: matrices, Algorithm 1, the plan."""
