"""``soft-jig plan``: print a plan, write it to files, and draw it as the page ``plan.html``."""
