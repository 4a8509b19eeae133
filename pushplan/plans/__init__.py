"""Data types of plans, executions and runs."""
