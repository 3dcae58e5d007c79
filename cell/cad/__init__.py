"""Parametric geometry of the parts and machines of the cell, written as SDF models.

``python -m cell.cad`` writes ``models/sdf``; nothing else in the cell imports this package.
"""
