"""The problem as arrays for compiled code: controls, exact connections, and what paths cost."""
