"""Make the README's pictures and output blocks anew: `python docs/refresh.py`, with the package installed."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURES = {
    "two-crates.png": "plan two-crates -o run.mcap --plot run.png",
    "stable-set.png": "stable-set two-crates --plot run.png",
}


def main() -> None:
    """Run the README's first command and the ones that draw its pictures; put in what they print and draw."""
    with tempfile.TemporaryDirectory() as folder:
        printed = [
            _run(words.split(), Path(folder), ROOT / "docs" / name) for name, words in PICTURES.items()
        ]
    readme = ROOT / "README.md"
    readme.write_text(with_output(readme.read_text(), printed[0]))


def with_output(text: str, output: str) -> str:
    """Return the README with its first block of output replaced."""
    return re.sub(r"(?<=```text\n).*?(?=```\n)", lambda _: output, text, count=1, flags=re.DOTALL)


def _run(words: list[str], folder: Path, picture: Path) -> str:
    command = [sys.executable, "-m", "pushplan", *words]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
    picture.write_bytes((folder / "run.png").read_bytes())
    return done.stdout


if __name__ == "__main__":
    main()
