"""SIGKILL at random moments: all reported results are in the remaining files, which can be read."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any

from attacking.measured import Attack, Row, commanded
from kinds import FAST

import pushplan
from pushplan.closed_loop import run_closed_loop
from pushplan.errors import PushplanError
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.settings import Observer
from pushplan.verification import verify_run

Tell = Callable[[float], None]

SCENARIOS = ("two-crates", "one-box", "narrow-gap", "free-space")
LIMIT, AFTER = 1.5, 0.5
"""Time limit of each plan, s; moments lie up to so long after it: paths are timed, executed and logged then."""


@cache
def _planned() -> Plan:
    return pushplan.plan(pushplan.load_scenario("two-crates"), seed=1, first=True, time_limit=60.0)


def _plan(log: Path, random: Random, tell: Tell) -> None:
    scenario = pushplan.load_scenario(random.choice(SCENARIOS))
    told = Observer(improved=lambda point: tell(point.cost))
    pushplan.run(scenario, log=log, seed=random.randrange(1000), time_limit=LIMIT, observer=told)


def _rearrangement(log: Path, random: Random, tell: Tell) -> None:
    told = Observer(improved=lambda point: tell(point.cost))
    scenario = pushplan.scenario_from_text(FAST["rearrangement"])
    pushplan.run(scenario, log=log, seed=random.randrange(1000), time_limit=LIMIT, observer=told)


def _trial(log: Path, random: Random, tell: Tell) -> None:
    uncertainty = TrialUncertainty(contact_friction=0.5)
    known = random.random() < 0.5
    what = _planned() if known else pushplan.load_scenario("two-crates")
    pushplan.trial(what, 20, uncertainty=uncertainty, log=log, progress=lambda end: tell(float(end.sample)))


def _closed_loop(log: Path, random: Random, tell: Tell) -> None:
    run_closed_loop(_planned().scenario, plan=_planned(), seed=random.randrange(1000), log=log, progress=tell)


def _costs(run: RecordedRun) -> list[float]:
    return [point.cost for point in run.improvements]


def _samples(run: RecordedRun) -> list[float]:
    return [float(end.sample) for end in run.trials]


def _seconds(run: RecordedRun) -> list[float]:
    """Return the times that can be reported once these samples are written: a rest of 1 s comes later."""
    end = 0.0 if run.execution is None else float(run.execution.t[-1])
    return [float(k) for k in range(int(end + 0.5) + 2)]


KINDS: dict[str, tuple[Callable[[Path, Random, Tell], None], Callable[[RecordedRun], list[float]], float]] = {
    "plan": (_plan, _costs, LIMIT + AFTER),
    "trial": (_trial, _samples, 4.0),
    "closed loop": (_closed_loop, _seconds, 4.0),
    "rearrangement": (_rearrangement, _costs, LIMIT + AFTER),
}
"""What is done and tells of it, what of that is in a log, and until when it may be killed, s."""

SUITE = """\
format: pushplan-suite/1
name: killed
problems: [one-box, two-crates]
planners: [auto, rrt]
seeds: 2
limits: {time: 60 s, iterations: 2000, run: 10 min, memory: 1 GB}
"""


def attacks(count: int, seed: int) -> Iterator[tuple[str, Attack]]:
    """Yield kills of all programs in turn."""
    kinds = [*KINDS, "bench"]
    for k in range(count):
        kind, random = kinds[k % len(kinds)], Random(f"{seed}-kill-{k}")
        if kind == "bench":
            yield f"{seed}-kill-{k}", partial(_kill_bench, random)
        else:
            yield f"{seed}-kill-{k}", partial(_kill, kind, random)


def _kill(kind: str, random: Random) -> Row:
    work, known, until = KINDS[kind]
    _planned()
    moment = random.uniform(0.0, until)
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        log = Path(folder, "killed.mcap")
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            try:
                work(log, random, lambda number: os.write(writing, f"{number.hex()}\n".encode()) and None)
            finally:
                os._exit(0)
        os.close(writing)
        time.sleep(moment)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        with os.fdopen(reading) as pipe:
            lines = pipe.read().splitlines(keepends=True)
        told = [float.fromhex(line) for line in lines if line.endswith("\n")]
        return {"group": kind, "moment": moment, "told": len(told), **_judged(log, told, known)}


def _judged(log: Path, told: list[float], known: Callable[[RecordedRun], list[float]]) -> Row:
    """Return the result of checking the remains of a program that has reported these numbers."""
    left = log if log.exists() else log.with_name(f"{log.name}.partial")
    if not left.exists() or left.stat().st_size == 0:
        return {"verdict": "WRONG" if told else "no log yet", "why": "no log" if told else ""}
    try:
        run = load_run(left, messages=True)
        found = known(run)
        if found[: len(told)] != told:
            return {"verdict": "WRONG", "why": f"told {told[-3:]}, in the log {found[-3:]} ({len(found)})"}
        report = verify_run(run)
        if not report.matches:
            return {"verdict": "WRONG", "why": "; ".join(check.text for check in report.mismatches)}
    except PushplanError as error:
        if told or left == log:
            return {"verdict": "WRONG", "why": str(error)}
        return {"verdict": "a log without its scenario"}
    code, _, said = commanded(["replay", str(left), "--json"])
    if code:
        return {"verdict": "WRONG", "why": f"replay: exit code {code}: {said[-300:]}"}
    whole = "whole" if left == log else "cut off, read and verified"
    return {"verdict": f"{whole}, {'with' if told else 'nothing told'} {'what was told' if told else 'yet'}"}


def _kill_bench(random: Random) -> Row:
    """Kill a batch, check its results, and resume it."""
    moment = random.uniform(0.0, 12.0)
    with tempfile.TemporaryDirectory(prefix="attack-") as place:
        folder = Path(place)
        (folder / "suite.yaml").write_text(SUITE)
        words = [
            sys.executable,
            "-m",
            "pushplan",
            "bench",
            str(folder / "suite.yaml"),
            "-o",
            str(folder / "out"),
            "--json",
        ]
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(moment)
        process.kill()
        process.wait()
        before = _rows(folder / "out" / "results.db")
        again = subprocess.run([*words, "--resume"], check=False, capture_output=True, text=True)
        after = _rows(folder / "out" / "results.db")
    row: Row = {"group": "bench", "moment": moment, "told": len(before)}
    if again.returncode != 0 or len(after) != 8 or not before <= after:
        why = f"exit code {again.returncode}, {len(before)} rows before, {len(after)} after: {again.stderr[-300:]}"
        return {**row, "verdict": "WRONG", "why": why}
    return {**row, "verdict": "resumed" if before else "resumed from nothing"}


def _rows(database: Path) -> set[Any]:
    """Return the results of a folder: key, number and outcome of each finished run."""
    if not database.exists():
        return set()
    with sqlite3.connect(database) as connection:
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
        if "pushplan_runs" not in tables:
            return set()
        over = "SELECT key, runid, outcome FROM pushplan_runs WHERE outcome IS NOT NULL"
        return set(connection.execute(over))
