"""Outcomes and metrics of the experiments against stored ones: ``soft-jig regress``."""
