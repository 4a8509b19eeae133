"""Print a script that lets a shell complete pushplan's words, files and examples."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE

SHELLS = ("bash", "zsh", "fish")

_FILES_AND_EXAMPLES = {
    "bash": "_pushplan_scenarios",
    "zsh": "_pushplan_scenarios",
    "fish": "(__fish_complete_path (commandline -ct); __pushplan_examples)",
}
_PREAMBLES = {
    "bash": "_pushplan_scenarios() {{\n  compgen -f -- $1\n  compgen -W '{names}' -- $1\n}}",
    "zsh": "_pushplan_scenarios() {{\n  _alternative 'files:file:_files' 'examples:example:({names})'\n}}",
    "fish": "function __pushplan_examples\n    string split ' ' -- '{names}'\nend",
}
_HOW = {
    "bash": "pushplan completion bash > ~/.local/share/bash-completion/completions/pushplan",
    "zsh": "pushplan completion zsh > a file _pushplan in a folder of $fpath",
    "fish": "pushplan completion fish > ~/.config/fish/completions/pushplan.fish",
}


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of {', '.join(SHELLS)}")
    parser.epilog = "Install, for new shells: " + "; ".join(f"`{line}`" for line in _HOW.values())


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    script = completion_script(args.shell, args.every_command)
    console.say(script)
    console.emit({"shell": args.shell, "script": script})
    return DONE


def completion_script(shell: str, top: argparse.ArgumentParser) -> str:
    """Return the script for one of `SHELLS` that completes what the parser `top` takes; it is changed by that."""
    import shtab

    from pushplan.scenario.file import example_names

    names = example_names()
    for action in _actions(top):
        _complete(action, shtab.FILE, names)
    preamble = _PREAMBLES[shell].format(names=" ".join(names))
    script: str = shtab.complete(top, shell, preamble=preamble)
    return script.rstrip("\n")


def _complete(action: Any, files: Mapping[str, object], names: tuple[str, ...]) -> None:
    """Say what may follow: a file, or an example's name, or both."""
    if action.metavar == "SCENARIO":
        action.complete = _FILES_AND_EXAMPLES
    elif action.metavar == "NAME" and not action.option_strings and action.nargs == "?":
        action.choices = names
    elif action.type is Path or action.metavar in ("RUN", "SUITE"):
        action.complete = files


def _actions(parser: argparse.ArgumentParser) -> Iterator[Any]:
    """Yield the actions of a parser and of its subparsers."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for child in action.choices.values():
                yield from _actions(child)
        else:
            yield action
