"""Where the bodies are, which of them touch, and whether they are free at start and goal."""
