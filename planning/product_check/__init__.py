"""What would fail if a product were assembled, found in seconds and without simulating."""
