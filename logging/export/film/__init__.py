"""The pictures of a film: what stands still, what moves, and both in the colours of video."""
