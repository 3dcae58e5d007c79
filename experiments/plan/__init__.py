"""``soft-jig plan``: print a plan and draw it as ``plan.html``, a page to look at.

What is fixed on the jig is decided in `planning`; here are the command and the page's pictures.
"""
