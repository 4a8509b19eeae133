"""What a ROS 2 bag is made of: frames, markers, messages, the file, and the files of viewers beside it."""
