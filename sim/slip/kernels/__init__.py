"""A step of the slip simulator in compiled code: touching bodies, floor friction, contact forces, motion."""
