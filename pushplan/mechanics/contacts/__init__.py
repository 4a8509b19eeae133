"""What every contact has to carry, and whether it holds."""
