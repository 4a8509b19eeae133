"""Plans of several pushes: contacts as push problems, search, timing, execution and verdict."""
