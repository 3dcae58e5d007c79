"""A user's own product on the command line: drafting it from CAD, and checking it."""
