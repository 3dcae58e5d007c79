"""How well the jig would hold: footprint, imprint, holding force, gripper; the general rule."""
