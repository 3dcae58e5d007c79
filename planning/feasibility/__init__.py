"""Which part is fixed on the jig in which posture: matrices and Algorithm 1."""
