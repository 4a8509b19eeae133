"""Driving a plan with a robot: measured poses of its base in, twists of its base out."""
