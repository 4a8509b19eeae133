"""Attacks on robustness and data safety: hostile files, invalid calls, kills, outputs.

    python benchmarks/attacks.py -o DIR [--only PART ...] [--count N] [--seed 1]

A whole run takes hours.

- *scenarios*: scenarios of every kind with each key mutated in turn. Each is refused with words or planned. Code that
  plans do not use checks solved ones: goals, collisions, contacts. The log is read and verified.
- *mutations*: logs of six kinds with random bytes altered. Each is read, or refused as damaged (exit code 2), or a
  mismatch (4); and recovered without any other error.
- *tampering*: logs with a value changed, or a record dropped or repeated, in every topic, metadata and attachment.
  `replay --verify` has to notice.
- *forgeries*: sound logs of plans that are invalid in the stated scenario, or of other numbers.
  `replay --verify` must confirm none.
- *bombs*: maps, drawings, YAML, logs and motions that would need gigabytes or hours without limits.
- *calls*: invalid numbers and objects as arguments of the Python interface; what should pickle is pickled.
- *kills*: SIGKILL at random moments of plans, trials, closed loops and rearrangements. The remaining log holds
  everything that they reported, and is verified.
- *interrupts*: Ctrl-C at random moments of commands and programs, imports included; no process aborts.
- *outputs*: every output option against a full and a closed file system in a mount namespace of their own, and
  against a link, a pipe and a folder in DIR.

Every attack but kills, interrupts and outputs is a process of its own in a temporary folder. It is wrong if it ends
with a traceback or an unexpected exit code, uses more than 500 MB, or more than 10 s of CPU time beyond the time
limit, starts a program, or writes a file elsewhere. DIR keeps the results; they are not made again. Prints a table;
exits 1 if anything was wrong.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a child of threads that spin would wait for them
sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from attacking import bombs, calls, interrupts, kills, logs, outputs, scenarios  # noqa: E402 (tests were just added)
from attacking.measured import Attacks, Row  # noqa: E402

PARTS: dict[str, tuple[int, Callable[[Path, int, int], Attacks]]] = {
    "scenarios": (1000, scenarios.attacks),
    "mutations": (1000, logs.mutations),
    "tampering": (2000, logs.tampering),
    "forgeries": (1000, logs.forgeries),
    "bombs": (200, bombs.attacks),
    "calls": (300, calls.attacks),
    "kills": (100, kills.attacks),
    "interrupts": (200, interrupts.attacks),
    "outputs": (1, outputs.attacks),
}
"""Default number of attacks, and their source."""


def main() -> int:
    """Attack, print the results and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", required=True, metavar="DIR")
    parser.add_argument("--only", nargs="*", choices=[*PARTS], default=[*PARTS])
    parser.add_argument("--count", type=int, help="of each part, in place of the usual ones")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = Path(options.output).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    wrong = 0
    for part in options.only:
        count, attacks = PARTS[part]
        chosen = attacks(folder, options.count or count, options.seed)
        wrong += _print(part, _done(folder / f"{part}.jsonl", chosen))
    return int(wrong > 0)


def _done(path: Path, attacks: Attacks) -> list[Row]:
    """Make the attacks that have no result yet; return all results."""
    lines = path.read_text().splitlines() if path.exists() else []
    rows = {str(row["key"]): row for row in map(json.loads, lines)}
    found: list[Row] = []
    with path.open("a") as file:
        for key, attack in attacks:
            if key not in rows:
                rows[key] = {"key": key, **attack()}
                file.write(json.dumps(rows[key], default=repr) + "\n")
                file.flush()
            found.append(rows[key])
            if rows[key]["verdict"] == "WRONG":
                print(f"  WRONG {json.dumps(rows[key], default=repr)}", flush=True)
            if len(found) % 100 == 0:
                print(f"  {path.stem}: {len(found)} done", flush=True)
    return found


def _print(part: str, rows: list[Row]) -> int:
    """Print the number of attacks by outcome; return the number of wrong ones."""
    wrong = sum(row["verdict"] == "WRONG" for row in rows)
    costs = [
        f", at most {max(float(row[name]) for row in rows):.1f} {unit}"
        for name, unit in (("mb", "MB"), ("seconds", "s of a processor"))
        if rows and name in rows[0]
    ]
    print(f"{part}: {len(rows)} attacks, {wrong} wrong{''.join(costs)}")
    for (group, verdict), count in sorted(Counter((r["group"], r["verdict"]) for r in rows).items()):
        print(f"  {group:28}{verdict:52}{count:5}")
    if part == "scenarios":
        print(f"  {scenarios.coverage_of(rows)}")
    sys.stdout.flush()
    return wrong


if __name__ == "__main__":
    sys.exit(main())
