"""The paper's experiments: ``soft-jig place``, ``soft-jig push``, and ``soft-jig regress``.

Postures and pushes, a trial with either hand, the criteria for trials and cases, and the report.
"""
