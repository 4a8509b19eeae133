"""The parser of the command line: what is not known is told with the known word that is most like it."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Iterable, Sequence
from typing import NoReturn

_CHOICES = re.compile(r"invalid choice: '(?P<word>.*?)' \(choose from (?P<known>.*)\)")


class Parser(argparse.ArgumentParser):
    """A parser that does not take beginnings of options for options, and suggests what may have been meant."""

    def __init__(self, **how: object) -> None:
        super().__init__(allow_abbrev=False, **how)  # type: ignore[arg-type]

    def error(self, message: str) -> NoReturn:
        """Write what is wrong and end the program with 2."""
        found = _CHOICES.search(message)
        if found is not None:
            message += nearest(found["word"], re.findall(r"[\w-]+", found["known"]))
        super().error(message)

    def parse_every(self, words: Sequence[str]) -> argparse.Namespace:
        """Return the words understood; an unknown option is told with the most similar one of its command."""
        args, unknown = self.parse_known_args(words)
        if not unknown:
            return args
        command: Parser = self.commands[args.command]
        first = unknown[0].partition("=")[0]
        if first.startswith("-"):
            command.error(f"unknown option {first}{nearest(first, command.options)}")
        command.error(f"does not expect {' '.join(unknown)!r}")

    @property
    def commands(self) -> dict[str, Parser]:
        """The parsers of the commands."""
        (children,) = (a for a in self._actions if isinstance(a, argparse._SubParsersAction))
        return dict(children.choices)

    @property
    def options(self) -> list[str]:
        """All options."""
        return list(self._option_string_actions)


def nearest(word: str, known: Iterable[str]) -> str:
    """Return `; did you mean '...'?` with the known word most like a word, or nothing."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"; did you mean '{close[0]}'?" if close else ""
