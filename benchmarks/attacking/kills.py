"""SIGKILL at random moments: all reported results are in the remaining files, which can be read.

`shards.py` kills batches.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from random import Random

from attacking.measured import Attacks, Row, commanded, wrong
from kinds import FAST

import pushplan
from pushplan.closed_loop import run_closed_loop
from pushplan.errors import PushplanError
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.settings import Observer
from pushplan.scenario.model import Scenario
from pushplan.verification import verify_run

Tell = Callable[[float], None]

SCENARIOS = ("two-crates", "one-box", "narrow-gap", "free-space")
LIMIT, AFTER = 1.5, 0.5
"""Time limit of each plan, and time after it in which paths are timed, executed and logged, s."""


@cache
def _planned() -> Plan:
    return pushplan.plan(pushplan.load_scenario("two-crates"), seed=1, first=True, time_limit=60.0)


def _plan(log: Path, random: Random, tell: Tell, scenario: Scenario | None = None) -> None:
    made = pushplan.load_scenario(random.choice(SCENARIOS)) if scenario is None else scenario
    told = Observer(improved=lambda point: tell(point.cost))
    pushplan.run(made, log=log, seed=random.randrange(1000), time_limit=LIMIT, observer=told)


def _rearrangement(log: Path, random: Random, tell: Tell) -> None:
    _plan(log, random, tell, pushplan.scenario_from_text(FAST["rearrangement"]))


def _trial(log: Path, random: Random, tell: Tell) -> None:
    uncertainty = TrialUncertainty(contact_friction=0.5)
    what = _planned() if random.random() < 0.5 else pushplan.load_scenario("two-crates")
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
"""Program that reports numbers, those numbers in a log, and the latest moment of the kill, s."""


def attacks(folder: Path, count: int, seed: int) -> Attacks:
    """Yield kills of all programs in turn."""
    _planned()
    for k in range(count):
        yield f"{seed}-kill-{k}", partial(_kill, [*KINDS][k % len(KINDS)], Random(f"{seed}-kill-{k}"))


def _kill(kind: str, random: Random) -> Row:
    """Kill a program at a random moment and check what is left."""
    work, known, until = KINDS[kind]
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
            told = [float.fromhex(line) for line in pipe.read().splitlines(keepends=True) if line.endswith("\n")]
        return {"group": kind, "moment": moment, "told": len(told), **_left(log, told, known)}


def _left(log: Path, told: list[float], known: Callable[[RecordedRun], list[float]]) -> Row:
    """Return the result of checking the remains of a program that has reported these numbers."""
    left = log if log.exists() else log.with_name(f"{log.name}.partial")
    if not left.exists() or left.stat().st_size == 0:
        return wrong("no log") if told else {"verdict": "no log yet"}
    try:
        run = load_run(left, messages=True)
        report = verify_run(run)
    except PushplanError as error:
        return wrong(str(error)) if told or left == log else {"verdict": "a log without its scenario"}
    if (found := known(run))[: len(told)] != told:
        return wrong(f"told {told[-3:]}, in the log {found[-3:]} ({len(found)})")
    if not report.matches:
        return wrong("; ".join(check.text for check in report.mismatches))
    code, _, said = commanded("replay", left, "--json")
    if code:
        return wrong(f"replay: exit code {code}: {said[-300:]}")
    whole = "whole" if left == log else "cut off, read and verified"
    return {"verdict": f"{whole}, {'with what was told' if told else 'nothing told yet'}"}
