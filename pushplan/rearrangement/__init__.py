"""Several objects to their goals, one after another; what is in the way is moved first."""
