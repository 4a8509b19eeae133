"""Searches for a single push: OMPL's planners and the project's own."""

from pushplan.util.interruption import import_uninterrupted

import_uninterrupted("ompl.base", "ompl.control", "ompl.util")
