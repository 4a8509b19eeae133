"""The chain against the obstacles: separation, swept arcs, and the scene they are asked in."""
