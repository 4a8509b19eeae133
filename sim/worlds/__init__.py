"""Chains that are not what a plan believes."""
