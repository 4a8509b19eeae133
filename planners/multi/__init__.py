"""Several pushes: drive to a face, push, back off, and again from another face until the goal is reached."""
