"""The paper's experiments: ``soft-jig place``, ``soft-jig push``, and ``soft-jig regress``.

Postures and pushes, one trial with either hand, how a trial and a case are judged, their report.
"""
