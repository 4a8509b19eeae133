"""Why no path is found: bounds on every path, and proofs that there is none."""
