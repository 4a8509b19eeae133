"""Plane geometry: poses, polygons, and their contacts and overlaps."""
