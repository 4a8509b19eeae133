"""Runs an attack in its own process and measures its time, memory, child processes and files elsewhere."""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from threading import Timer
from typing import Any

from pushplan.cli.main import main

Row = dict[str, Any]
Attack = Callable[[], Row]

MOST_MB, MOST_SECONDS = 500.0, 10.0
"""What an attack may take of memory, and of a processor beyond the time limit that it states."""

TAKEN: list[float] = []
"""Processor time of each command in this process, s."""

_STARTS = {"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "os.forkpty"}
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def measured(work: Callable[[Path], Row], limit: float = 0.0) -> Row:
    """Do an attack in a child and an empty folder; return what it says, what it takes, and a verdict.

    Args:
        work: Gets the folder, which is the working directory, too; its row has a `verdict`.
        limit: Seconds that it may search by its own words.
    """
    reading, writing = os.pipe()
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        child = os.fork()
        if child == 0:
            os.close(reading)
            _attacked(work, Path(folder), writing)
        os.close(writing)
        watch = Timer(30.0 * (MOST_SECONDS + limit), os.kill, (child, signal.SIGKILL))
        watch.start()
        with os.fdopen(reading) as pipe:
            told = pipe.read()
        _, status, used = os.wait4(child, 0)
        watch.cancel()
    row: Row = json.loads(told) if told else {"verdict": "WRONG", "why": f"ended by status {status}", "mb": 0.0}
    row.setdefault("seconds", used.ru_utime + used.ru_stime)
    why = row.get("why", "")
    if row["mb"] > MOST_MB:
        why += f"; {row['mb']:.0f} MB"
    if row["seconds"] > limit + MOST_SECONDS:
        why += f"; {row['seconds']:.1f} s"
    if row.get("outside"):
        why += f"; {row['outside']}"
    return {**row, "verdict": "WRONG", "why": why} if why else row


def _attacked(work: Callable[[Path], Row], folder: Path, writing: int) -> None:
    """Run the attack in the child, report the row, and end."""
    outside: list[str] = []

    def hook(event: str, args: tuple[Any, ...]) -> None:
        if event in _STARTS:
            outside.append(f"{event} {args[:2]}")
            raise PermissionError(outside[-1])  # told, and not done
        elif event == "open" and isinstance(args[0], str | bytes) and (args[2] or 0) & _WRITES:
            path = os.path.realpath(os.fsdecode(args[0]))
            if not path.startswith((os.path.realpath(folder), "/dev/null")):
                outside.append(f"wrote {path}")
                raise PermissionError(outside[-1])

    os.chdir(folder)
    os.environ["PUSHPLAN_RUNS"] = str(folder / "runs")
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
    sys.addaudithook(hook)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        row = work(folder)
    except BaseException:
        row = {"verdict": "WRONG", "why": traceback.format_exc()[-1500:]}
    taken = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    row |= {"seconds": max(TAKEN)} if TAKEN else {}
    row |= {"mb": taken / 1024.0, "outside": "; ".join(outside)[:300]}
    os.write(writing, json.dumps(row).encode())
    os._exit(0)


def commanded(words: list[str]) -> tuple[int, str, str]:
    """Run a command of pushplan in this process; return its exit code, its output and its errors."""
    out, err = io.StringIO(), io.StringIO()
    began = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    TAKEN.append(time.process_time() - began)
    return code, out.getvalue(), err.getvalue()
