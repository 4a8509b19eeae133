"""`python -m pushplan` is the command line."""

from pushplan.cli.entry import entry

if __name__ == "__main__":
    entry()
