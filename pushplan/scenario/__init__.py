"""Reads scenario files: syntax, values and geometry, with all errors reported at once."""
