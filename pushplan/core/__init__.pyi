"""Compiled inner loops; each submodule is described in its own stub."""

SOURCES: str
"""Digest of the sources that this core was compiled from."""
