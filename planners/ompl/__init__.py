"""OMPL as the spine: every push problem posed as OMPL's users know it, and the planners that solve it."""
