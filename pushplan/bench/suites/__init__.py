"""What a suite asks for: its file, its problems, and the runs that they come to."""
