"""Steps a built cell through phases that command it.

What happened is logged, and the state of a run can be saved and restored.
"""
