"""Closed loop: observe the objects, replan from their measured poses, close contacts, or give up with a reason."""
