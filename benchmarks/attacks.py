"""Attacks on what must not be lost or hurt: outputs against what they could destroy, hostile logs, kills of plans.

Run `python benchmarks/attacks.py -o DIR [--mutations 1000] [--bombs 200] [--kills 200] [--commands 20] [--seed 1]
[--only outputs|mutations|bombs|kills|commands]`.

- *outputs*: every output option of every command against a device, a full and a closed file system in a mount
  namespace of their own, and against a link, a pipe and a folder in DIR.
- *mutations*: logs with records or bytes altered at random; *bombs*: logs of up to 50 MB that would take gigabytes or
  hours if nothing bounded that, some of them altered, too. Each must be read, or refused with the one error that a
  damaged log leads to, strictly and recovering, within 500 MB and 10 s of a processor.
- *kills*: SIGKILL at random moments of `pushplan.run`, in a process that tells every improvement of its path. The log
  must hold all that was told by then, and its best path must be one that drives to the goal.
- *commands*: SIGKILL at random moments of `pushplan plan`, from its first instruction on; what it leaves must be no
  log, or one that `pushplan replay` takes.

What is done is kept in DIR and not done again. Prints a table; exits 1 when anything was lost or hurt.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import stat
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from threading import Thread, Timer

import numpy as np

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS)]

from output_options import OPTIONS, words  # noqa: E402 (in tests, where the path has just been set)
from store.test_hostile import FILES  # noqa: E402

from pushplan.errors import PushplanError, RunLogError  # noqa: E402
from pushplan.logging.reader import load_run  # noqa: E402
from pushplan.logging.recorded import RecordedRun  # noqa: E402
from pushplan.plans.plan import Improvement  # noqa: E402
from pushplan.plans.settings import Observer  # noqa: E402
from pushplan.run import run  # noqa: E402
from pushplan.scenario.file import load_scenario  # noqa: E402

SCENARIOS = ("two-crates", "one-box", "narrow-gap", "free-space")
LIMIT = 1.5
"""Time limit of each plan, s."""
AFTER = 0.5
"""Moments lie up to so long after it, s: paths are timed, executed and logged then."""

MOST_MB, MOST_SECONDS = 500.0, 10.0
"""What reading a log may take."""
COSTS = (("peak_mb", "MB"), ("seconds", "s"))

Row = dict[str, object]


def main() -> int:
    """Attack, print what became of it and return the exit code."""
    options = _options()
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    parts: dict[str, Callable[[], Iterator[tuple[str, Callable[[], Row]]]]] = {
        "outputs": lambda: _outputs(folder),
        "mutations": lambda: _mutations(folder, options.mutations, options.seed),
        "bombs": lambda: _bombs(folder, options.bombs, options.seed),
        "kills": lambda: _kills(folder, options.kills, options.seed),
        "commands": lambda: _commands(folder, options.commands, options.seed),
    }
    wrong = 0
    for part, attacks in parts.items():
        if options.only in (None, part):
            wrong += _print(part, _done(folder / f"{part}.jsonl", attacks()))
    return int(wrong > 0)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--output", required=True, metavar="DIR")
    parser.add_argument("--mutations", type=int, default=1000)
    parser.add_argument("--bombs", type=int, default=200)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--commands", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=("outputs", "mutations", "bombs", "kills", "commands"))
    return parser.parse_args()


def _done(path: Path, attacks: Iterator[tuple[str, Callable[[], Row]]]) -> list[Row]:
    """Do the attacks that are not done yet; return what became of all of them."""
    lines = path.read_text().splitlines() if path.exists() else []
    rows = {str(row["key"]): row for row in map(json.loads, lines)}
    found: list[Row] = []
    with path.open("a") as file:
        for key, attack in attacks:
            if key not in rows:
                rows[key] = {"key": key, **attack()}
                file.write(json.dumps(rows[key]) + "\n")
                file.flush()
            found.append(rows[key])
    return found


def _print(part: str, rows: list[Row]) -> int:
    """Print how many attacks ended how, and every wrong one; return how many are wrong."""
    wrong = [row for row in rows if row["verdict"] == "WRONG"]
    most = [
        f", at most {max(float(str(r[k])) for r in rows):.2f} {u}" for k, u in COSTS if rows and k in rows[0]
    ]
    print(f"{part}: {len(rows)} attacks, {len(wrong)} wrong{''.join(most)}")
    for (group, verdict), count in sorted(
        Counter((str(r["group"]), str(r["verdict"])) for r in rows).items()
    ):
        print(f"  {group:28}{verdict:44}{count:5}")
    for row in wrong:
        print(f"  WRONG {json.dumps(row)}")
    sys.stdout.flush()
    return len(wrong)


def _outputs(folder: Path) -> Iterator[tuple[str, Callable[[], Row]]]:
    log = _sound(folder)
    for command, option, suffix in OPTIONS:
        for place in ("link", "pipe", "folder"):
            key = f"{command} {option} {place}"
            yield key, lambda c=command, o=option, s=suffix, p=place: _attack_output(folder, log, c, o, s, p)
    unshare = ["unshare", "--map-root-user", "--mount"]
    if subprocess.run([*unshare, "true"], check=False).returncode:
        print("  no mount namespace here: devices and file systems are left out")
        return
    where = folder / f"places-{os.getpid()}"
    where.mkdir()
    script = [*unshare, sys.executable, str(TESTS / "outputs_in_namespace.py"), str(where), str(log)]
    done = subprocess.run(script, check=True, capture_output=True, text=True)
    for place, command, option, code, error, kind, others in json.loads(done.stdout):
        kept = kind == ("character device" if place == "devices" else "nothing") and not others
        verdict = {0: "written", 2: "refused"}.get(code, "WRONG") if kept else "WRONG"
        row: Row = {"group": place, "verdict": verdict, "error": error}
        yield f"{command} {option} {place}", lambda row=row: row


def _attack_output(folder: Path, log: Path, command: str, option: str, suffix: str, place: str) -> Row:
    """Run a command whose output is named like a link, a pipe or a folder; look whether that is still there."""
    path, aside = folder / f"{place}{suffix}", folder / f"aside{suffix}"
    for old in (path, aside):
        if old.is_dir() and not old.is_symlink():
            old.rmdir()
        else:
            old.unlink(missing_ok=True)
    kinds = {"link": stat.S_IFLNK, "pipe": stat.S_IFIFO, "folder": stat.S_IFDIR}
    if place == "link":
        aside.write_text("old")
        path.symlink_to(aside.name)
    elif place == "pipe":
        os.mkfifo(path)
        Thread(target=path.read_bytes, daemon=True).start()
    else:
        path.mkdir()
    program = [sys.executable, "-m", "pushplan", *words(command, option, path, log)]
    code = subprocess.run(program, check=False, capture_output=True).returncode
    kept = stat.S_IFMT(os.lstat(path).st_mode) == kinds[place]
    if place == "pipe":  # nobody may have opened it: let its reader go
        os.close(os.open(path, os.O_RDWR))
    verdict = {0: "written", 2: "refused"}.get(code, "WRONG") if kept else "WRONG"
    return {"group": place, "verdict": verdict, "code": code}


def _sound(folder: Path) -> Path:
    """Return the log that attacks begin with."""
    log = folder / "attacked.mcap"
    if not log.exists():
        run(load_scenario("one-box"), log=log, first=True)
    return log


def _read(path: Path) -> Row:
    """Return what a process of its own makes of a log, strictly and when it recovers, and what that takes."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        told = [_outcome(path, recover) for recover in (False, True)]
        taken = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        os.write(writing, json.dumps([*told, taken / 1024.0]).encode())
        os._exit(0)
    os.close(writing)
    watch = Timer(20.0 * MOST_SECONDS, os.kill, (child, signal.SIGKILL))
    watch.start()
    _, _, used = os.wait4(child, 0)
    watch.cancel()
    with os.fdopen(reading) as pipe:
        strict, recovering, peak = json.loads(pipe.read() or '["ended", "ended", 0.0]')
    seconds = used.ru_utime + used.ru_stime
    row: Row = {"peak_mb": peak, "seconds": seconds}
    if {strict, recovering} <= {"read", "refused"} and peak < MOST_MB and seconds < MOST_SECONDS:
        return {**row, "verdict": f"{strict}, {recovering} when recovered"}
    return {**row, "verdict": "WRONG", "why": [strict, recovering]}


def _outcome(path: Path, recover: bool) -> str:
    try:
        load_run(path, recover=recover, messages=True)
    except RunLogError:
        return "refused"
    except BaseException as error:
        return repr(error)
    return "read"


def _mutations(folder: Path, count: int, seed: int) -> Iterator[tuple[str, Callable[[], Row]]]:
    log = _sound(folder).read_bytes()
    for k in range(count):
        key = f"{seed}-mutation-{k}"
        yield key, lambda key=key: _attack_reader(folder, key, lambda: _mutated(log, Random(key)))


def _mutated(log: bytes, random: Random) -> bytes:
    """Return a log with bits flipped, pieces left out, repeated or overwritten, or cut off."""
    made = bytearray(log)
    for _ in range(random.randint(1, 4)):
        at, size = random.randrange(len(made)), random.randint(1, 64)
        match random.choice(("flip", "drop", "repeat", "overwrite", "cut")):
            case "flip":
                made[at] ^= 1 << random.randrange(8)
            case "drop":
                del made[at : at + size]
            case "repeat":
                made[at:at] = made[at : at + size]
            case "overwrite":
                made[at : at + size] = random.randbytes(size)
            case "cut":
                del made[max(at, 1) :]
    return bytes(made)


def _bombs(folder: Path, count: int, seed: int) -> Iterator[tuple[str, Callable[[], Row]]]:
    names = [*FILES]
    for k in range(count):
        name, key = names[k % len(names)], f"{seed}-bomb-{k}"
        yield key, lambda key=key, name=name: _attack_reader(folder, key, lambda: _bomb(name, Random(key)))


def _bomb(name: str, random: Random) -> bytes:
    """Return a hostile file, every other one with a few bytes altered."""
    made = bytearray(FILES[name][0]())
    for _ in range(random.choice((0, random.randint(1, 5))) if made else 0):
        made[random.randrange(len(made))] ^= 1 << random.randrange(8)
    return bytes(made)


def _attack_reader(folder: Path, key: str, make: Callable[[], bytes]) -> Row:
    path = folder / f"{key}.mcap"
    path.write_bytes(make())
    row = _read(path)
    if row["verdict"] != "WRONG":  # one that is wrong is kept
        path.unlink()
    return {"group": "logs", **row}


def _kills(folder: Path, count: int, seed: int) -> Iterator[tuple[str, Callable[[], Row]]]:
    for name in SCENARIOS if count else ():
        load_scenario(name)
        run(load_scenario(name), log=False, time_limit=0.3)
    for k in range(count):
        yield f"{seed}-{k}", lambda k=k: _kill(folder, Random(f"{seed}-{k}"))


def _kill(folder: Path, random: Random) -> Row:
    """Kill a run at a random moment and compare its log with what it had told."""
    name, moment = random.choice(SCENARIOS), random.triangular(0.0, LIMIT + AFTER, 0.0)  # most runs end soon
    log = folder / "killed.mcap"
    for path in (log, log.with_name("killed.mcap.partial")):
        path.unlink(missing_ok=True)
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _run_and_tell(name, log, random.randrange(1000), writing)
    os.close(writing)
    time.sleep(moment)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(reading) as pipe:
        told = [float.fromhex(line) for line in pipe.read().splitlines(keepends=True) if line.endswith("\n")]
    return {"group": name, "moment": moment, "told": len(told), **_judged(log, told)}


def _run_and_tell(name: str, log: Path, seed: int, writing: int) -> None:
    def improved(point: Improvement) -> None:
        os.write(writing, f"{point.cost.hex()}\n".encode())

    try:
        run(load_scenario(name), log=log, seed=seed, time_limit=LIMIT, observer=Observer(improved=improved))
    finally:
        os._exit(0)


def _judged(log: Path, told: list[float]) -> Row:
    """Return the verdict on what a killed run has left, when it had told paths of these costs."""
    left = log if log.exists() else log.with_name(f"{log.name}.partial")
    if not left.exists() or left.stat().st_size == 0:
        return {"verdict": "WRONG" if told else "no log"}
    try:
        found = load_run(left)
        costs = [point.cost for point in found.improvements]
        if costs[: len(told)] != told:
            return {"verdict": "WRONG", "why": f"told {len(told)} paths, {len(costs)} in the log"}
        return _replayed(found, bool(told), left == log)
    except PushplanError as error:
        if told or left == log:
            return {"verdict": "WRONG", "why": str(error)}
        return {"verdict": "a log without its scenario"}


def _replayed(found: RecordedRun, told: bool, whole: bool) -> Row:
    plan, execution = found.plan, found.execution
    known = plan.segments if plan is not None else found.improvements[-1].segments if told else ()
    if not known:
        return {"verdict": "WRONG" if told and plan is None else "replays, no path was known"}
    goal = found.scenario.goal
    off = known[-1].contact_path.end - goal.pose_chain
    if np.hypot(off[0], off[1]) > goal.position_tolerance or (
        execution is not None and execution.loss is not None
    ):
        return {"verdict": "WRONG", "why": "the best path does not lead to the goal"}
    if whole:
        return {"verdict": "whole log"}
    return {"verdict": "replays its best path" if plan is None else "replays its plan"}


def _commands(folder: Path, count: int, seed: int) -> Iterator[tuple[str, Callable[[], Row]]]:
    began = time.monotonic()
    plan = ["plan", "two-crates", "--time-limit", str(LIMIT)]
    program = [sys.executable, "-m", "pushplan"]
    if count:
        subprocess.run([*program, *plan, "--no-log"], check=True, capture_output=True)
    whole = time.monotonic() - began
    for k in range(count):
        moment = Random(f"{seed}-command-{k}").uniform(0.0, whole)
        yield f"{seed}-{k}", lambda moment=moment: _kill_command(folder, program, plan, moment)


def _kill_command(folder: Path, program: list[str], plan: list[str], moment: float) -> Row:
    runs = folder / "runs"
    for old in runs.glob("*.mcap*") if runs.exists() else ():
        old.unlink()
    process = subprocess.Popen(
        [*program, *plan, "--runs", str(runs)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    time.sleep(moment)
    process.kill()
    process.wait()
    left = [path for path in runs.glob("*.mcap*") if path.stat().st_size] if runs.exists() else []
    if not left:
        return {"group": "pushplan plan", "moment": moment, "verdict": "no log"}
    done = subprocess.run(
        [*program, "replay", "--runs", str(runs), "--json"], check=False, capture_output=True, text=True
    )
    row: Row = {"group": "pushplan plan", "moment": moment, "verdict": "WRONG", "why": done.stderr[-300:]}
    if done.returncode == 0:
        told = json.loads(done.stdout)
        row |= {"verdict": f"replays, {told['outcome']}", "cost": told.get("path_cost")}
    return row


if __name__ == "__main__":
    sys.exit(main())
