"""Make pictures, output and figures of README and docs anew: `python docs/refresh.py`, with the package installed.

With names, such as `two-crates.png`, only these pictures. Those of viewers are made by `docs/screens.py`.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from stamp import content_of, stamp

from pushplan.cli.main import main as main_of_pushplan
from pushplan.scenario.file import example_text

ROOT = Path(__file__).parents[1]
FIXED = "--iterations 20000 --time-limit 600"
"""Ends searches at the same place on every machine: the picture is of the same plan."""
TRIED = "contact_friction=60%,floor_friction=30%,load=30%,position=2mm,angle=0.3deg"
PICTURES = {
    "two-crates.png": "plan two-crates",
    "stable-set.png": "stable-set two-crates",
    "four-sets.png": "stable-set two-crates --set ecof --set cof --set robust --set stable",
    "own-scenario.png": "check docs/mine.yaml",
    "several-pushes.png": "plan examples/bring_it_home.yaml --first --time-limit 600",
    "pencils.png": "plan examples/pencils.yaml --first --time-limit 600",
    "from-a-map.png": f"plan examples/office/push.yaml {FIXED}",
    "gallery-carts.png": f"plan carts {FIXED}",
    "gallery-rearrangement.png": "plan docs/gallery/change-places.yaml --time-limit 4",
    "gallery-closed-loop.png": "simulate two-crates --closed-loop --disturb time=5s,object=far,y=5mm",
    "gallery-trial.png": f"trial two-crates --samples 100 --uncertainty {TRIED}",
    "gallery-unsolved.png": "plan docs/gallery/walled-in.yaml --iterations 2000 --time-limit 600",
}
"""Commands of the pictures, run in the repository; each is drawn with `--plot`, a closed loop from its log."""
NOT_COMPARED = ("two-crates.png", "gallery-rearrangement.png", "gallery-closed-loop.png", "gallery-trial.png")
"""Pictures whose plan is made within a time limit: of these the scenario alone is hashed."""
SEEDS = range(1, 21)
NUMBER = """\
The search finds a first path for three boxes through fifteen obstacles in 4 m by 4 m (`three-boxes-clutter`) in
**{median:.2g} ms** of CPU time (median over seeds 1 to {count}; the slowest: {worst:.2g} ms; {cores} shared cores
of a virtual machine). The path reaches the goal exactly. The time in the output above includes preparing, timing and
checking. The installation from a clone needs a C++ compiler (`apt install g++ python3-dev`).
"""
CPU_TIME = "import time; time.perf_counter = time.process_time; from pushplan.__main__ import entry; entry()"
"""A program that runs `pushplan` with CPU time as its clock, so that other work on the machine does not count."""


def main() -> None:
    """Make the pictures that are asked for; without names all of them, and what the README prints and measures."""
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[1:] or PICTURES:
            draw(name, Path(folder))
            print(name)
        if not sys.argv[1:]:
            first = _run(["plan", "two-crates", "-o", "run.mcap", "--plot", "run.png"], Path(folder))
            page = ROOT / "docs" / "_static" / "two-crates.html"
            _run(["replay", "run.mcap", "--html", str(page)], Path(folder))
    if not sys.argv[1:]:
        readme = ROOT / "README.md"
        readme.write_text(with_number(with_output(readme.read_text(), first), number()))


def draw(name: str, folder: Path) -> None:
    """Make a picture, and write into it what it shows."""
    command, log = PICTURES[name].split(), folder / "run.mcap"
    drawn = ["--plot", str(folder / "run.png")]
    if command[0] == "simulate":
        _run([*command, "-o", str(log), "--no-page"], ROOT)
        _run(["replay", str(log), *drawn], ROOT)
    else:
        _run([*command, *drawn, *(["--no-log"] if command[0] in ("plan", "trial") else [])], ROOT)
    (ROOT / "docs" / name).write_bytes((folder / "run.png").read_bytes())
    stamp(ROOT / "docs" / name, content(name))


def content(name: str) -> str:
    """Return the hash of what a picture shows at present."""
    command = PICTURES[name].split()
    if name in NOT_COMPARED:
        return content_of(scenario_text(command[1]), {})
    words = [*command, "--json", *(["--no-log"] if command[0] == "plan" else [])]
    with contextlib.chdir(ROOT), contextlib.redirect_stdout(io.StringIO()) as printed:
        main_of_pushplan(words)
    return content_of(scenario_text(command[1]), json.loads(printed.getvalue()))


def scenario_text(source: str) -> str:
    """Return the text of a scenario: a file of the repository, or a packaged one."""
    file = ROOT / source
    return file.read_text() if file.is_file() else example_text(source)


def with_output(text: str, output: str) -> str:
    """Return the README with its first block of output replaced."""
    return re.sub(r"(?<=```text\n).*?(?=```\n)", lambda _: output, text, count=1, flags=re.DOTALL)


def with_number(text: str, sentence: str) -> str:
    """Return the README with its paragraph about the first path replaced."""
    return re.sub(r"The search finds a first path\b.*?\n(?=\n)", lambda _: sentence, text, count=1, flags=re.DOTALL)


def number() -> str:
    """Return the paragraph about the first path, measured now."""
    words = ["plan", "three-boxes-clutter", "--first", "--time-limit", "10", "--json", "--no-log", "--seed"]
    found = [json.loads(_run([*words, str(seed)], ROOT, ["-c", CPU_TIME])) for seed in SEEDS]
    if not all(plan["solved"] for plan in found):
        raise SystemExit("a seed has no path after 10 s of CPU time")
    times = [1e3 * plan["first_solution_s"] for plan in found]
    return NUMBER.format(median=median(times), worst=max(times), count=len(SEEDS), cores=os.cpu_count())


def _run(words: list[str], folder: Path, program: Sequence[str] = ("-m", "pushplan")) -> str:
    command = [sys.executable, *program, *words]
    return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=False).stdout


if __name__ == "__main__":
    main()
