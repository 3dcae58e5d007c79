"""What works on the product, as handles: arms, their tools, the jig's base, sensors.

The soft jig itself has a package of its own.
"""
