"""A chain as a model of the physics engine: bodies on feet, contacts, and how it is simulated."""
