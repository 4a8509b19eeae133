"""The scene that the chain moves in: convex pieces of what moves and what stands."""
