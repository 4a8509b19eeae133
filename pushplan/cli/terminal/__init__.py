"""Words from and to the terminal: options, messages, numbers, progress."""
