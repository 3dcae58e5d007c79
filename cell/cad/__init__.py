"""Geometry of everything in the cell, with parameters, and its way into SDF files.

``python -m cell.cad`` writes ``models/sdf``; nothing else in the cell imports it.
"""
