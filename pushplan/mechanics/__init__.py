"""Mechanics: chains, supports, floor friction and contact wrenches."""
