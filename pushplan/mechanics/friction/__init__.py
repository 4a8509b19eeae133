"""The wrench with which the floor resists one object whose load is known."""
