"""Identification of friction and loads from measured pushes."""
