"""One part on the jig, as the paper's experiments see it: what is looked at and recorded.

A hand on a carriage, the rig, stands in for the arm; strokes are for either hand.
"""
