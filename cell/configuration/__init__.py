"""Every number of the cell that a user may change, each with its unit, range and source.

Configuration files and overrides are read and checked here, and the default file is written.
"""
