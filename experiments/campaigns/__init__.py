"""Campaigns: many trials of one experiment, each kept as it ends, on one machine or a cluster.

A trial is a function of experiment, product, configuration and seed. Its key is a digest of these
and of the code; its file is ``trials/<key>.json``. The files are the truth, everything else in the
folder is made from them.
"""
