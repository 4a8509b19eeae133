"""Make the figures of Harada et al. 2006 anew, into docs/harada2006.

Run `python examples/harada2006/make_figures.py [--out DIR] [--format svg] [--cors 400] [--figures 6 7 9 11 12]`;
without a format, all are SVG but Fig. 11, which has too many points for that. Figs. 11 and 12 are simulated with real
contacts and need the extra `pushplan[physics]`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import figure6
import figure7
import figure9
import figure11
import figure12

ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    """Draw the figures that are asked for and print what the simulations give."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "harada2006")
    parser.add_argument("--format", choices=("svg", "png", "pdf"))
    parser.add_argument(
        "--cors", type=int, default=400, help="centres of rotation for each friction angle in Fig. 11"
    )
    parser.add_argument("--figures", type=int, nargs="+", choices=(6, 7, 9, 11, 12), default=[6, 7, 9, 11, 12])
    wanted = parser.parse_args()
    wanted.out.mkdir(parents=True, exist_ok=True)
    drawings = {
        6: figure6.draw,
        7: figure7.draw,
        9: figure9.draw,
        11: lambda path: figure11.draw(path, wanted.cors, print),
        12: lambda path: figure12.draw(path, print),
    }
    for number in wanted.figures:
        suffix = wanted.format or ("png" if number == 11 else "svg")
        path = wanted.out / f"fig{number}.{suffix}"
        drawings[number](path)
        print(path)


if __name__ == "__main__":
    main()
