"""From files to scenarios: syntax, values, geometry, and everything wrong told at once."""
