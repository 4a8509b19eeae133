"""Multi-push plans: drive to a face, push, back off, and repeat at other faces until the goal is reached."""
