"""Lower bounds of every path, and proofs that none exists."""
