"""Utilities for all other modules: array types, shared names, files, text for terminals, clocks and Ctrl-C."""
