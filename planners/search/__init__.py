"""Searches in rounds: sparse trees, and best-first search over cells of poses."""
