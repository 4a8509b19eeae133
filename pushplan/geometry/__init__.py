"""Plane geometry: poses, polygons, and how two of them touch or overlap."""
