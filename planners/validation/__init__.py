"""Independent checks of a path: no code shared with the planners."""
