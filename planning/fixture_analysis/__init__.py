"""How well the jig would hold a candidate: footprint, imprint, capacity, room for the gripper."""
