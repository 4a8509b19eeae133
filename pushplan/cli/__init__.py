"""The commands of the command line, one module each: `declare` declares its words, `run` does the work."""
