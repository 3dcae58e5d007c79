"""Element tests of the soft jig alone: the rig, the specimens, and each test.

`element_reference.yaml` has the discrete-element results that they are compared with.
"""
