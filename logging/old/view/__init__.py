"""What viewers see of a run: the scene, its frames, the rectangle around it, the layout, a summary in words."""
