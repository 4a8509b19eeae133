"""Random push problems: a chain that can be pushed, in a room with walls and clutter."""
