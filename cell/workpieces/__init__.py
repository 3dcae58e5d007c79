"""The product in the plant: its loose parts, and the screw threads of its bolts.

A part sleeps while nothing touches it; a thread catches, advances, clamps and locks.
"""
