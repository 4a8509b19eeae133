"""Stable sets as polygons of centres of rotation."""
