"""One part on the jig in the paper's experiments: the observed stage, its record, and the rig.

The rig, a hand on a carriage, replaces the arm.
"""
