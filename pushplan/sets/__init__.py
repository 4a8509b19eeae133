"""Stable sets of body twists and their exact boundaries."""
