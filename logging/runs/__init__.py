"""The folder in which every run is recorded: its names, what it holds, and how old ones are let go."""
