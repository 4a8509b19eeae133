"""Commands of the command line, one module each; rarely used ones are in `more`."""
