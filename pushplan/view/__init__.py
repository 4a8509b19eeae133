"""A window to play with: a scenario in a browser, its poses dragged, its plan shown at once."""
