"""How well the jig would hold a candidate body: support, grip, imprint, capacity, and the score."""
