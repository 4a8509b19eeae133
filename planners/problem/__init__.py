"""What a search plans: controls, the problem, what paths cost, and the rest of an earlier path."""
