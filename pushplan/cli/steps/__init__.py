"""What the longer commands are made of: a step of work or a part of the output each."""
