"""In which order a product can be put together: precedence, the best orders, proofs of none."""
