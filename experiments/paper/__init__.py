"""The paper's experiments: ``soft-jig place`` and ``soft-jig push``.

Postures and pushes, a trial with either hand, the criteria for trials and cases, and the report.
"""
