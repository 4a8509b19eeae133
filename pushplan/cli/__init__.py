"""The commands of the command line, one module each, those that few need in `more`."""
