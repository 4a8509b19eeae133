"""The commands of the command line, one module each: `add_parser` declares its words, `run` does the work."""
