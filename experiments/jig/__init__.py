"""Element tests of the soft jig alone: the rig, what is pressed into the bed, and each test.

The discrete-element figures that they are compared with lie beside them.
"""
