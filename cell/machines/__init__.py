"""What works on the product, as handles: arms, their tools, the jig's base, sensors.

Fixtures are in `cell.fixtures`.
"""
