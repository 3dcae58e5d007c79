"""Parametric geometry of everything in the cell; ``python -m cell.cad`` writes ``models/sdf``."""
