"""Trajectories that do not stop where the twist changes."""
