"""Quasi-static pushing in which contacts stick, slide, roll off an end, open and close again."""
