"""YAML text as a tree whose nodes know their line and column, and findings told at those places."""
