"""What logs cost: the share of a run's time, the size of a file, the memory of reading an hour.

Run `python benchmarks/logs.py [--runs 9] [--cpu]`. For each packaged scenario, with its own settings:

- *call*: `pushplan.run(scenario, log=FILE)` in a process that has run before, the median of runs. Logging is what the
  run's own watch counts; `more` is how much longer a run takes than one without a log, the two taking turns.
- *process*: a process from its start to its end that loads the program, plans and logs once, as
  `pushplan plan SCENARIO -o FILE` does; logging includes loading what only logging needs.
- *CPU*: writing the log of a run that is there already, and loading the writer, seconds of the processor: what to
  compare between two versions on a machine that is busy otherwise (`--cpu`, alone and fast).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pushplan.bench.processes.machine import Machine
from pushplan.kernels import warm_up
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.reader import read_run
from pushplan.logging.writer import RunLogWriter
from pushplan.run import run
from pushplan.scenario.file import example_names, load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario

ONE_RUN = """\
import json, sys
import pushplan
from pushplan.kernels import warm_up
scenario = pushplan.load_scenario(sys.argv[1])
warm_up(scenario.planner.name)
print(json.dumps(pushplan.run(scenario, log=sys.argv[2]).seconds))
"""

ONE_REPLAY = """\
import pathlib, re, sys
from pushplan.cli.main import main
code = main(sys.argv[1:])
print(re.search(r"VmHWM:\\s+(\\d+)", pathlib.Path("/proc/self/status").read_text())[1], file=sys.stderr)
sys.exit(code)
"""

LOAD_WRITER = """\
import time, pushplan.run
before = time.process_time()
import pushplan.logging.writer
print(time.process_time() - before)
"""

NINE_BODIES = """\
format: pushplan/1
floor: {friction: 0.3}
contacts: {friction: 0.5}
pusher: {width: 0.2, thickness: 0.03, friction: 0.5}
goal: {pose: [3.7, 0.2, 5 deg]}
planner: {seed: 1}
objects:
""" + "".join(f"  - {{name: box{k}, shape: {{box: [0.1, 0.12]}}, mass: 0.5}}\n" for k in range(9))

HOUR = 3600.0


def timed(scenario: Scenario, log: Path | None) -> tuple[float, float]:
    began = time.perf_counter()
    done = run(scenario, log=log or False)
    return time.perf_counter() - began, done.seconds.get("logging", 0.0)


def calls(scenario: Scenario, log: Path, runs: int) -> tuple[float, float, float]:
    """Seconds of a run with a log, of its logging, and more than without a log."""
    warm_up(scenario.planner.name)
    timed(scenario, log)
    pairs = [(timed(scenario, None), timed(scenario, log)) for _ in range(runs)]
    whole, logging, more = np.median(
        [(logged, part, logged - bare) for (bare, _), (logged, part) in pairs], axis=0
    )
    return whole, logging, more


def process(name: str, log: Path) -> tuple[float, float]:
    """Seconds of a whole process, and of its logging."""
    began = time.perf_counter()
    command = [sys.executable, "-c", ONE_RUN, name, str(log)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return time.perf_counter() - began, json.loads(done.stdout)["logging"]


def shares(folder: Path, runs: int) -> float:
    print(f"{'':22}{'':>18}{'call, ms':>34}{'process, ms':>28}")
    names = ("duration s", "KB", "whole", "logging", "share", "more", "whole", "logging", "share")
    print(
        f"{'scenario':22}"
        + "".join(f"{name:>9}" if name != "duration s" else f"{name:>12}" for name in names)
    )
    worst = 0.0
    for name in example_names():
        log = folder / f"{name}.mcap"
        whole, logging, more = calls(load_scenario(name), log, runs)
        command, part = np.median([process(name, log) for _ in range(max(3, runs // 3))], axis=0)
        duration = run(load_scenario(name)).plan.trajectory
        length = duration.duration if duration else 0.0
        worst = max(worst, part / command)
        print(
            f"{name:22}{length:12.1f}{log.stat().st_size / 1000:9.0f}"
            f"{1e3 * whole:9.0f}{1e3 * logging:9.1f}{logging / whole:9.1%}{1e3 * more:9.1f}"
            f"{1e3 * command:9.0f}{1e3 * part:9.1f}{part / command:9.1%}",
            flush=True,
        )
    return worst


def rewrite(run: RecordedRun, log: Path) -> None:
    assert run.plan is not None
    assert run.execution is not None
    with RunLogWriter.create(log, run.scenario, run.words["pushplan.run"]) as writer:
        writer.plan(run.plan)
        writer.execution(run.execution)
        writer.finish(run.outcome)


def processor(folder: Path, runs: int) -> None:
    """Print what writing takes, given the runs, and loading what writes."""
    for name in ("two-crates", "nine-bodies"):
        log = folder / f"{name}.mcap"
        run(scenario_from_text(NINE_BODIES) if name == "nine-bodies" else load_scenario(name), log=log)
        recorded, spent = read_run(log), []
        for _ in range(10 * runs):
            began = time.process_time()
            rewrite(recorded, log)
            spent.append(time.process_time() - began)
        print(f"writing {name}: {1e3 * np.median(spent):.2f} ms CPU, {1e3 * min(spent):.2f} at least")
    loading = [
        float(subprocess.run([sys.executable, "-c", LOAD_WRITER], check=True, capture_output=True).stdout)
        for _ in range(runs)
    ]
    print(f"loading the writer: {1e3 * np.median(loading):.1f} ms CPU, {1e3 * min(loading):.1f} at least")


def nine_bodies(folder: Path) -> None:
    done = run(scenario_from_text(NINE_BODIES), log=folder / "nine.mcap")
    assert done.execution is not None
    size = (folder / "nine.mcap").stat().st_size
    print(
        f"9 bodies, {done.execution.t[-1]:.1f} s, {len(done.execution.t)} samples: {size / 1000:.0f} KB (limit 400)"
    )


def hour(folder: Path) -> None:
    """Write the log of an hour, a run repeated, and read it in other processes."""
    done = run(load_scenario("two-crates"))
    execution = done.execution
    assert execution is not None
    count = round(HOUR * 100)
    again = np.resize(np.arange(len(execution.t)), count)
    names = ("poses", "twists", "margins", "friction_margins", "lambdas", "forces")
    longer = {name: getattr(execution, name)[again] for name in names}
    began = time.perf_counter()
    with RunLogWriter.create(folder / "hour.mcap", done.scenario, {}) as log:
        log.plan(done.plan)
        log.execution(replace(execution, t=np.arange(count) / 100.0, **longer))
        log.finish("solved")
    size = (folder / "hour.mcap").stat().st_size
    print(f"an hour, {count} samples: {size / 1e6:.1f} MB, written in {time.perf_counter() - began:.1f} s")
    for words in ([], ["--html", "hour.html"], ["--csv", "hour.csv"]):
        began = time.perf_counter()
        command = [sys.executable, "-c", ONE_REPLAY, "replay", "hour.mcap", *words]
        replayed = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
        peak, took = int(replayed.stderr.split()[-1]) / 1024, time.perf_counter() - began
        print(f"replay {' '.join(words):17} {peak:6.0f} MiB at most (limit 300), {took:5.1f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--cpu", action="store_true", help="time the processor only")
    arguments = parser.parse_args()
    print(Machine.this().words)
    with tempfile.TemporaryDirectory() as folder:
        processor(Path(folder), arguments.runs)
        if arguments.cpu:
            return
        worst = shares(Path(folder), arguments.runs)
        print(f"largest share of a process: {worst:.1%} (limit 5 %)")
        nine_bodies(Path(folder))
        hour(Path(folder))


if __name__ == "__main__":
    main()
