"""The command line: ``soft-jig``, its commands, and their options as typed classes.

Options are checked here; the work is done in the other folders, imported when a command runs.
"""
