"""The plan as a whole: Algorithm 1's steps with orders and evidence, a general rule beside it.

Also how a plan is written to a file and explained in words.
"""
