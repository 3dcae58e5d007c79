"""``soft-jig assemble``: plan a product, then run its whole assembly in the twin.

What a run is asked for, the cell it runs in, what a person sees of it, and what it leaves behind.
"""
