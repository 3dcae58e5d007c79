"""Every number of the cell that a user may change, each with its unit, range and source.

Configuration files and overrides are read and checked here; the default file and the parameter
table of the documentation are written by ``python -m cell.configuration``.
"""
