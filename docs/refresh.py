"""Make pictures, output and figures of README and docs anew: `python docs/refresh.py`, with the package installed.

With names, such as `two-crates.png`, only these pictures. Those of viewers are made by `docs/screens.py`.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from stamp import stamp

ROOT = Path(__file__).parents[1]
PICTURES = {
    "two-crates.png": "plan two-crates -o run.mcap --plot run.png",
    "stable-set.png": "stable-set two-crates --plot run.png",
    "four-sets.png": "stable-set two-crates --set ecof --set cof --set robust --set stable --plot run.png",
    "own-scenario.png": f"check {ROOT}/docs/mine.yaml --plot run.png",
    "several-pushes.png": f"plan {ROOT}/examples/bring_it_home.yaml --time-limit 4 -o run.mcap --plot run.png",
    "pencils.png": f"plan {ROOT}/examples/pencils.yaml --first -o run.mcap --plot run.png",
    "from-a-map.png": f"plan {ROOT}/examples/office/push.yaml -o run.mcap --plot run.png",
}
SEEDS = range(1, 21)
NUMBER = """\
The first path is there after **{median:.2g} ms** (median over seeds 1 to {count}; the slowest: {worst:.2g} ms): three
boxes through fifteen obstacles in 4 m by 4 m (`three-boxes-clutter`), the goal reached exactly, on {cores} shared
cores of a virtual machine. Setting it up from a clone takes a C++ compiler
(`apt install g++ python3-dev`); nothing is compiled later.
"""


def main() -> None:
    """Make the pictures that are asked for; without names all of them, and what the README prints and measures."""
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[1:] or PICTURES:
            printed = _run(PICTURES[name].split(), Path(folder))
            (ROOT / "docs" / name).write_bytes((Path(folder) / "run.png").read_bytes())
            stamp(ROOT / "docs" / name)
            if name == "two-crates.png":
                _run(
                    ["replay", "run.mcap", "--html", str(ROOT / "docs" / "_static" / "two-crates.html")],
                    Path(folder),
                )
                first = printed
    if not sys.argv[1:]:
        readme = ROOT / "README.md"
        readme.write_text(with_number(with_output(readme.read_text(), first), number()))


def with_output(text: str, output: str) -> str:
    """Return the README with its first block of output replaced."""
    return re.sub(r"(?<=```text\n).*?(?=```\n)", lambda _: output, text, count=1, flags=re.DOTALL)


def with_number(text: str, sentence: str) -> str:
    """Return the README with its paragraph about the first path replaced."""
    return re.sub(
        r"The first path is there after\b.*?\n(?=\n)", lambda _: sentence, text, count=1, flags=re.DOTALL
    )


def number() -> str:
    """Return the paragraph about the first path, measured now."""
    command = ["plan", "three-boxes-clutter", "--time-limit", "1", "--json", "--seed"]
    found = [json.loads(_run([*command, str(seed)], ROOT)) for seed in SEEDS]
    times = [1e3 * plan["first_solution_s"] for plan in found]
    return NUMBER.format(median=median(times), worst=max(times), count=len(SEEDS), cores=os.cpu_count())


def _run(words: list[str], folder: Path) -> str:
    command = [sys.executable, "-m", "pushplan", *words]
    return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=True).stdout


if __name__ == "__main__":
    main()
