"""Contact conditions for all loads and pressures that are possible."""
