"""The best path so far: how it is kept and shortened, and when a search is over."""
