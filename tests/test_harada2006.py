"""The example that makes the paper's figures anew."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from pushplan.scenario.file import load_scenario

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "harada2006"


def made(out: Path, *words: str) -> str:
    """Run the example's one command and return what it prints."""
    command = [sys.executable, str(EXAMPLE / "make_figures.py"), "--out", str(out), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_the_figures_of_the_sets_are_made(tmp_path: Path) -> None:
    made(tmp_path, "--figures", "6", "7", "9")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fig6.svg", "fig7.svg", "fig9.svg"]
    assert all("</svg>" in path.read_text() for path in tmp_path.iterdir())


@pytest.mark.skipif(
    find_spec("mujoco") is None, reason="MuJoCo is not installed; the extra pushplan[physics] brings it"
)
def test_the_figures_of_the_experiments_are_made(tmp_path: Path) -> None:
    """All centres of rotation are counted; the two blocks stay together on the way to the goal."""
    printed = made(tmp_path, "--figures", "11", "12", "--cors", "2", "--format", "png")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fig11.png", "fig12.png"]
    counts = [line.split()[-2:] for line in printed.splitlines() if line.startswith("Algorithm 1")]
    held, moved = np.array(counts, dtype=int).reshape(2, 2, 2).swapaxes(0, 2)
    assert (held.sum() + moved.sum()) == 4
    assert moved[0].sum() == held[1].sum() == 0
    assert printed.count(" held: ") == 2
    assert " moved from " not in printed


def test_scenarios_say_what_the_paper_says() -> None:
    """Friction angles of 14 and 29 degrees; that the plate has the larger one is ours."""
    angles = [
        np.degrees(np.arctan(c.friction)) for c in load_scenario(EXAMPLE / "two-blocks.yaml").chain.contacts
    ]
    assert angles == pytest.approx([29.0, 14.0])
    for angle in (14, 29):
        (contact,) = load_scenario(EXAMPLE / f"one-block-{angle}deg.yaml").chain.contacts
        assert np.degrees(np.arctan(contact.friction)) == pytest.approx(angle)
