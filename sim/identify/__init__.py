"""Friction and loads found from pushes that somebody measured."""
