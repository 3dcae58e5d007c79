"""Studies on top of campaigns: what is run in a trial, and what follows from all of them.

The scripts are `pose_error_study`, `jig_design_study` and `product_variants`.
"""
