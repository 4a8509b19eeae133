"""Outlines and obstacles from files of other programs: drawings, tables, maps."""
