"""The results on disk: a database that Planner Arena opens, and tables for other programs."""
