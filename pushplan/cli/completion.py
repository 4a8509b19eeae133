"""Print a script that lets a shell complete pushplan's words, files and examples."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from pushplan.cli import parameters as p
from pushplan.cli.console import Console


@p.command
@click.argument("shell", type=click.Choice(("bash", "zsh", "fish")), metavar="SHELL")
def completion(console: Console, shell: str) -> int:
    r"""Print a script that lets bash, zsh or fish complete pushplan's words, files and examples.

    \b
    Install it, for new shells:
      pushplan completion bash > ~/.local/share/bash-completion/completions/pushplan
      pushplan completion zsh > a file _pushplan in a folder of $fpath
      pushplan completion fish > ~/.config/fish/completions/pushplan.fish
    """
    from pushplan.cli.main import pushplan

    made = get_completion_class(shell)
    assert made is not None
    script = made(pushplan, {}, "pushplan", "_PUSHPLAN_COMPLETE").source().rstrip("\n")
    console.say(script)
    console.emit({"shell": shell, "script": script})
    return 0


command = completion
