"""The fork server's own program: one thread, everything loaded, and a fork for each message.

A message is the path of a run's folder, with three descriptors: `life`, on which the server tells the process's
descriptor (a pidfd, race-free since only this process reaps it) and in the end its exit status; `result`, which
the run writes to; and `sentinel`, a pipe whose other end only the supervisor holds. The server keeps nothing else:
when it is killed, the runs that it forked go on.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
import struct
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from pushplan.bench.processes.child import carry_out

READY = b"ready"
"""What the server says when everything is loaded."""

WORD = struct.Struct("!i")
"""What it says of a process: first its number, then its exit status as `subprocess` gives it."""

MOST_PATH = 4096
"""Bytes of a folder's path, at most."""


def serve(control: socket.socket, preload: str) -> NoReturn:
    """Load what runs need and fork them until the supervisor is gone.

    Args:
        control: Brings the messages; its end is the server's end.
        preload: Name of a module to import first.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the supervisor
    import_module(preload)
    selector = selectors.DefaultSelector()
    selector.register(control, selectors.EVENT_READ)
    with contextlib.suppress(OSError):  # a supervisor that is gone already is noticed below
        control.send(READY)
    while True:
        for key, _ in selector.select():
            if key.fileobj is control:
                _fork(control, selector)
            else:
                _bury(key, selector)


def _fork(control: socket.socket, selector: selectors.BaseSelector) -> None:
    try:
        message, descriptors, _, _ = socket.recv_fds(control, MOST_PATH, 3)
    except ConnectionError:
        message = b""
    if not message:
        # Without the interpreter's clean-up, in which OMPL's bindings list what they call leaks on the screen.
        os._exit(0)
    number = os.fork()
    if not number:
        _become_run(message, descriptors, control, selector)
    life, result, sentinel = descriptors
    os.close(result)
    os.close(sentinel)
    process = os.pidfd_open(number)
    channel = socket.socket(fileno=life)
    with contextlib.suppress(OSError):  # the supervisor may have given the run up, which ends it
        socket.send_fds(channel, [WORD.pack(number)], [process])
    selector.register(process, selectors.EVENT_READ, (number, channel))


def _become_run(
    message: bytes, descriptors: list[int], control: socket.socket, selector: selectors.BaseSelector
) -> NoReturn:
    """Go on as a run; what is open for other runs would tell their supervisor that the server lives."""
    try:
        life, result, sentinel = descriptors
        os.close(life)
        for key in list(selector.get_map().values()):
            if key.data is not None:
                os.close(key.fd)
                key.data[1].close()
        control.close()
        selector.close()
        carry_out(Path(os.fsdecode(message)), result, sentinel)
    finally:
        os._exit(1)


def _bury(key: selectors.SelectorKey, selector: selectors.BaseSelector) -> None:
    """Take the exit status of a process that has ended and tell it."""
    number, channel = key.data
    selector.unregister(key.fileobj)
    os.close(key.fd)
    status = os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
    with channel, contextlib.suppress(OSError):
        channel.send(WORD.pack(status))
