"""Play a recorded run as time goes by: in the terminal, or to viewers that connect."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.errors import PushplanError

if TYPE_CHECKING:
    from pushplan.logging.messages.recorded import RecordedRun
    from pushplan.logging.play.playback import Playback

LINGER = 2.0
"""Seconds for which a server stays after the end, so that the last messages arrive."""


def declare_playing(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    group = parser.add_argument_group("playing")
    group.add_argument("--play", action="store_true", help="play the run in this terminal")
    group.add_argument(
        "--serve",
        metavar="PORT",
        type=int,
        nargs="?",
        const=8765,
        help="play the run to Foxglove and Lichtblick, which connect to ws://localhost:PORT (8765)",
    )
    group.add_argument(
        "--rate", metavar="X", type=float, default=1.0, help="simulated seconds per second (1)"
    )
    group.add_argument(
        "--start-offset", metavar="S", type=float, default=0.0, help="begin at S simulated seconds"
    )
    group.add_argument("--duration", metavar="S", type=float, help="play S simulated seconds")
    group.add_argument("--loop", action="store_true", help="begin again at the end, until interrupted")


def play(recorded: RecordedRun, args: argparse.Namespace, console: Console) -> None:
    """Play the run where that was asked for.

    Raises:
        PushplanError: When there is nothing to play, no terminal, or the port cannot be had.
    """
    from pushplan.logging.play.playback import Playback

    how = Playback(args.rate, args.start_offset, args.duration, args.loop)
    if args.serve is not None:
        _serve(recorded, args.serve, how, console)
    elif args.play:
        if not sys.stdout.isatty():
            raise PushplanError(
                "--play draws on a terminal, but the output goes elsewhere; use --html or --mp4"
            )
        from pushplan.logging.play.terminal import play_in_terminal

        play_in_terminal(recorded, sys.stdout, how)


def _serve(recorded: RecordedRun, port: int, how: Playback, console: Console) -> None:
    from pushplan.logging.play.live import LiveServer

    server = LiveServer(recorded.scenario.name, port=port)
    try:
        console.note(f"playing to ws://localhost:{server.port}; Ctrl-C ends it")
        server.play(recorded, how)
        server.linger(LINGER)
    finally:
        server.stop()
