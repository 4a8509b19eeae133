"""Mechanics: chains, supports, floor friction, and what every contact has to carry."""
