"""The commands of the command line, one module each; its `command` is what runs."""
