"""What the objects' inertia adds to the contact conditions."""
