"""Searches in rounds: sparse trees, and best-first search over cells of poses."""

from pushplan.util.interruption import import_uninterrupted

import_uninterrupted("ompl.base", "ompl.control", "ompl.util")
