"""Ctrl-C at random moments of programs and commands, also during imports: nothing aborts or reports a defect."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from functools import cache, partial
from pathlib import Path
from random import Random

from attacking.measured import Attacks, Row, wrong

PYTHON = [sys.executable, "-c"]
PUSHPLAN = [sys.executable, "-m", "pushplan"]
PROGRAMS = {
    "import": [*PYTHON, "import pushplan.ompl, pushplan.planners.timing.exact_timing"],
    "plan in Python": [*PYTHON, "import pushplan; pushplan.plan(pushplan.load_scenario('hook'), time_limit=0.5)"],
    "plan": [*PUSHPLAN, "plan", "hook", "--no-log", "--time-limit", "0.5"],
    "stable-set": [*PUSHPLAN, "stable-set", "two-crates"],
    "check": [*PUSHPLAN, "check", "two-crates"],
    "simulate": [*PUSHPLAN, "simulate", "one-box", "--time-limit", "0.5"],
}


def attacks(folder: Path, count: int, seed: int) -> Attacks:
    """Yield interrupts of all programs in turn; half of them get a second one."""
    for k in range(count):
        key = f"{seed}-interrupt-{k}"
        yield key, partial(attack, [*PROGRAMS][k % len(PROGRAMS)], Random(key))


def attack(name: str, random: Random) -> Row:
    """Interrupt a program at a random moment."""
    moment = random.uniform(0.0, 1.1 * _seconds(name))
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        process = _started(name, folder)
        time.sleep(moment)
        process.send_signal(signal.SIGINT)
        if random.random() < 0.5:
            time.sleep(random.uniform(0.0, 0.1))
            process.send_signal(signal.SIGINT)
        try:
            _, said = process.communicate(timeout=600.0)
        except subprocess.TimeoutExpired:
            process.kill()
            return {"group": name, "moment": moment, **wrong("it goes on")}
    code, text = process.returncode, said.decode(errors="replace")
    row: Row = {"group": name, "moment": moment, "code": code}
    if code in (-signal.SIGABRT, -signal.SIGSEGV) or "defect" in text or "terminate called" in text:
        return row | wrong(text[-1500:])
    return {**row, "verdict": "done before" if code == 0 else "interrupted"}


@cache
def _seconds(name: str) -> float:
    """Return the duration of a program without interrupts, s."""
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        began = time.monotonic()
        _started(name, folder).communicate()
        return time.monotonic() - began


def _started(name: str, folder: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PUSHPLAN_RUNS": folder}
    # What shells start in the background ignores Ctrl-C; so would these.
    return subprocess.Popen(
        PROGRAMS[name],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.default_int_handler),
    )
