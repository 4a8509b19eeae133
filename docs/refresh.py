"""Make pictures, output and figures of README and docs anew: `python docs/refresh.py`, with the package installed."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[1]
PICTURES = {
    "two-crates.png": "plan two-crates -o run.mcap --plot run.png",
    "stable-set.png": "stable-set two-crates --plot run.png",
    "four-sets.png": "stable-set two-crates --set ecof --set cof --set robust --set stable --plot run.png",
    "own-scenario.png": "check mine.yaml --plot run.png",
    "several-pushes.png": f"plan {ROOT}/examples/bring_it_home.yaml -o run.mcap --plot run.png",
}
SEEDS = range(1, 21)
NUMBER = """\
The first path is there after **{median:.2g} ms** (median over seeds 1 to {count}; the slowest: {worst:.2g} ms): three
boxes through fifteen obstacles in 4 m by 4 m (`three-boxes-clutter`), the goal reached exactly, on {cores} shared
cores of a virtual machine, with the compiled code loaded. On its first run on a machine, pushplan compiles
for about a minute.
"""


def main() -> None:
    """Run the README's first command and those that draw its pictures; put in what they print and draw."""
    with tempfile.TemporaryDirectory() as folder:
        page = (ROOT / "docs" / "own-scenario.md").read_text()
        steps = re.findall(r"```yaml\n(.*?)```", page, flags=re.DOTALL)
        (Path(folder) / "mine.yaml").write_text("".join(steps))
        printed = [
            _drawn(words.split(), Path(folder), ROOT / "docs" / name) for name, words in PICTURES.items()
        ]
    readme = ROOT / "README.md"
    readme.write_text(with_number(with_output(readme.read_text(), printed[0]), number()))


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


def _drawn(words: list[str], folder: Path, picture: Path) -> str:
    printed = _run(words, folder)
    picture.write_bytes((folder / "run.png").read_bytes())
    return printed


def _run(words: list[str], folder: Path) -> str:
    command = [sys.executable, "-m", "pushplan", *words]
    return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=True).stdout


if __name__ == "__main__":
    main()
