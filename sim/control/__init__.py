"""Closed loop: watch the objects, plan again from where they are, close contacts, or give up with a reason."""
