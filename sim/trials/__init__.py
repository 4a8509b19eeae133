"""Trials: a plan executed in many sampled worlds, and what share of them it arrives in."""
