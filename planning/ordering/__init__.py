"""Orders of assembly: precedence, the best ones, and proofs that there is none."""
