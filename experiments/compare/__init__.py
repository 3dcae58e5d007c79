"""What differs between two results, campaigns or plans: ``soft-jig compare``.

`tolerances` is the one table of what may drift and why; ``soft-jig regress`` uses it as well.
"""
