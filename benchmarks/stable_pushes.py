"""411 real pushes with two fingers, stable and unstable: does the margin predict which contacts held?

    python benchmarks/stable_pushes.py [--seed 58] [--draws 20] [--jobs 1] [--plot docs/real-pushes.png]

Prints figures, those with a target next to it. `stable_pushes.csv` has recordings of a laboratory
(github.com/robinzhoucmu/MLab_EXP, Apache-2.0):

* An aluminium right triangle (legs 150 mm, 1.518 kg) on three feet or its flat underside, pushed by a plate with two
  tips 50 mm apart at 2.5 mm/s. Positions are in the frame of its right corner, mm; angles deg; forces N.
* `px, py` is the point between the tips and `ax, ay` the direction of approach. The plate turns by `amount` about
  `mx, my` (`rot`) or moves by `amount` along it (`trans`). `pre_*`, `post_*`: poses at rest.
* `f_n, f_t`: mean force along the approach and to its left; useless where `onset` is below 0.06.
* The tips' heading is off the edge by 0.58 deg (mode of all pushes). The script takes it off.

A push is kept if the object moves on the plate by less than 1.5 mm along and across and 1 deg, and slips clearly
beyond twice that. No motion is fitted: friction comes from the recorded forces (`slides`), loads of the feet from the
centre of mass, heights from the drawing.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import mannwhitneyu
from script import options, tell

from pushplan.drawing.palette import ARRIVED, MISSED
from pushplan.geometry import se2
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sim.identify.identify import identify_pushes
from pushplan.sim.identify.measured_push import MeasuredPush
from pushplan.sim.slip import simulate_poses
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

FRICTION = 0.35
"""Of contacts that slide: the ratio of recorded forces (`slides`)."""
OTHERS = {0.50: "sticking, as a tilt test gives it", 0.95: "tabulated, in the authors' scripts"}
HEADING = np.radians(0.58)
KEPT = np.array([1.5e-3, 1.5e-3, np.radians(1.0)])
FEET = {
    "30_90_30": [[0.03, 0.03], [0.09, 0.03], [0.03, 0.09]],
    "30_63": [[0.03, 0.03], [0.06333, 0.04333], [0.04333, 0.06333]],
}
CENTRE, CORNERS = (0.05, 0.05), [[0.0, 0.0], [0.15, 0.0], [0.0, 0.15]]
TIPS, UNDERSIDE = 0.0125, 0.0026
"""Heights of the tips above the underside, and of the feet, m."""
SURE = 0.05
SLIPPING = 12


@dataclass(frozen=True, eq=False)
class Push:
    """One push.

    Attributes:
        support: One of `FEET`, or `patch`.
        plate: Pose (3,) of the plate in the object's frame before the push, m and rad.
        twist: Twist (3,) of the plate in its own frame, times the duration of the push.
        poses: Poses (101, 3) of the plate in the object's frame before the push.
        after: Final pose (3,) of the object in the same frame, corrected for the heading of the tips.
        ratio: Ratio of the forces along and across the plate; NaN if they were not measured.
    """

    support: str
    plate: FloatArray
    twist: FloatArray
    poses: FloatArray
    after: FloatArray
    ratio: float

    @classmethod
    def of(cls, row: Any) -> Push:
        """Return the push of a row of the file."""
        plate = np.array([1e-3 * row.px, 1e-3 * row.py, np.arctan2(row.ay, row.ax)])
        if row.kind == "trans":
            twist = np.array([*se2.rotate(-plate[2], 1e-3 * row.amount * np.array([row.mx, row.my])), 0.0])
        else:
            centre = se2.transform_points(se2.inverse(plate), 1e-3 * np.array([[row.mx, row.my]]))[0]
            twist = np.radians(row.amount) * np.array([centre[1], -centre[0], 1.0])
        poses = se2.compose(plate, se2.exp(np.linspace(0.0, 1.0, 101)[:, None] * twist))
        pre = np.array([1e-3 * row.pre_x, 1e-3 * row.pre_y, np.radians(row.pre_deg)])
        post = np.array([1e-3 * row.post_x, 1e-3 * row.post_y, np.radians(row.post_deg)])
        on_plate = se2.relative(poses[-1], se2.relative(pre, post))
        after = se2.compose(poses[-1], se2.compose([0.0, 0.0, HEADING], on_plate))
        return cls(row.support, plate, twist, poses, after, abs(row.f_t / row.f_n) if row.onset > 0.06 else np.nan)

    @cached_property
    def moved(self) -> FloatArray:
        """Motion (3,) of the plate on the object: ahead, to the left, angle."""
        return se2.relative(self.plate, se2.relative(self.after, self.poses[-1]))

    @cached_property
    def size(self) -> float:
        """Motion of the object on the plate; up to 1, the push was kept."""
        off = np.array([*self.moved[:2], se2.wrap_angle(self.moved[2])])
        return float((np.abs(off) / KEPT).max())

    def scenario(self, friction: float) -> Scenario:
        """Return the push as a scenario."""
        height, support = TIPS, "uniform"
        if feet := FEET.get(self.support):
            loads = np.linalg.solve(np.vstack([np.ones(3), np.transpose(feet)]), [1.0, *CENTRE])
            height, support = TIPS + UNDERSIDE, {"feet": [[*p, float(w)] for p, w in zip(feet, loads, strict=True)]}
        pose, shape = se2.inverse(self.plate).tolist(), {"polygon": CORNERS}
        triangle = {"name": "triangle", "shape": shape, "mass": 1.518, "support": support, "pose": pose}
        return scenario_from_document(
            {
                "format": "pushplan/1",
                "name": "stable-push",
                "floor": {"friction": 0.29},
                "contacts": {"friction": friction},
                "objects": [triangle],
                "pusher": {"width": 0.05, "friction": friction, "contact_height": height},
                "start": self.plate.tolist(),
                "goal": {"pose": [1.0, 0.0, 0.0]},
            }
        )

    def margin(self, friction: float) -> float:
        """Return the margin of the push."""
        return float(self.scenario(friction).stable_set().margin(self.twist[None])[0])

    def predicted(self) -> FloatArray:
        """Return the final pose (3,) of the object in the slip simulator."""
        world = World.from_scenario(self.scenario(FRICTION))
        return simulate_poses(np.arange(101.0), self.poses, world).objects[-1, 0]

    @property
    def measured(self) -> MeasuredPush:
        """The plate's poses, and those of the object before and after, for identification."""
        objects = np.full((101, 1, 3), np.nan)
        objects[0], objects[-1] = 0.0, self.after
        return MeasuredPush(self.poses, objects)


def read() -> list[Push]:
    """Return all pushes."""
    return [Push.of(row) for row in pd.read_csv(Path(__file__).with_suffix(".csv"), comment="#").itertuples()]


def slides(pushes: list[Push]) -> None:
    """Print the ratio of forces while both tips slide, and while the object sticks."""
    slid = [p.ratio for p in pushes if abs(p.moved[1]) > 2.0 * KEPT[1] and abs(p.moved[2]) < KEPT[2]]
    low, middle, high = np.nanpercentile(slid, [25, 50, 75])
    print(f"  forces while both tips slide: {middle:.2f} ({low:.2f} to {high:.2f}, {np.isfinite(slid).sum()} pushes)")
    print(f"  of those that were kept: up to {np.nanmax([p.ratio for p in pushes if p.size < 1.0]):.2f}")


def margins(pushes: list[Push]) -> bool:
    """Compare margins and ends of pushes with what was measured, for each support and for other frictions."""
    table = pd.DataFrame({"support": [p.support for p in pushes], "size": [p.size for p in pushes]})
    for friction in (FRICTION, *OTHERS):
        table[friction] = [p.margin(friction) for p in pushes]

    def counts(rows: pd.DataFrame) -> str:
        return f"{(rows['size'] < 1.0).sum():3} kept, {(rows['size'] > 2.0).sum():3} clear slips"

    def area(rows: pd.DataFrame, friction: float) -> float:
        """Return the area under the ROC curve: how often a kept push has a larger margin than one that slipped."""
        kept, slipped = rows.loc[rows["size"] < 1.0, friction], rows.loc[rows["size"] > 2.0, friction]
        return float(mannwhitneyu(kept, slipped).statistic) / (len(kept) * len(slipped))

    for support, rows in table.groupby("support"):
        above = [int(((rows["size"] > 2.0) & (rows[FRICTION] > least)).sum()) for least in (0.0, SURE)]
        print(
            f"  {support:9} {len(rows):3}: {counts(rows)}, area {area(rows, FRICTION):.3f}, clear slips above 0 and "
            f"{SURE}: {above[0]} and {above[1]}"
        )
    for friction in (FRICTION, *OTHERS):
        rows, what = table[table[friction] > SURE], OTHERS.get(friction, "sliding")
        told = f"{len(rows):3} above {SURE}: {counts(rows)}; area {area(table, friction):.3f}"
        print(f"  friction {friction:.2f} ({what}): {told}")
    slipped = [p for p in pushes if p.size > 2.0]
    ends = se2.pose_errors(*(np.array(one) for one in zip(*((p.predicted(), p.after) for p in slipped), strict=True)))
    gone = 1e3 * np.median([np.hypot(*p.moved[:2]) for p in slipped])
    p50, p90 = np.percentile(ends * [1e3, np.degrees(1.0)], [50, 90], axis=0).round(2)
    print(f"  ends of {len(ends)} clear slips (median {gone:.1f} mm on the plate): off by {p50}, 90 % {p90}")
    good = tell(f"{len(pushes)} pushes, area under the ROC curve", area(table, FRICTION), ">=", 0.95)
    slips = ((table["size"] > 2.0) & (table[FRICTION] > SURE)).sum()
    return good & tell(f"clear slips with a margin above {SURE}", slips, "<=", 2)


def learned(chosen: list[Push]) -> tuple[float, float, float]:
    """Return the interval and the median of the friction that identification learns from pushes."""
    world = World.from_scenario(chosen[0].scenario(0.95))
    one = identify_pushes(world, [p.measured for p in chosen], jobs=1).estimates[0]
    return one.low, one.median, one.high


def identified(pushes: list[Push], seed: int, draws: int, jobs: int) -> bool:
    """Let identification learn the friction from a dozen pushes that slipped, on three feet, drawn at random."""
    slipping = [p for p in pushes if p.size > 2.0 and p.support == "30_90_30"]
    random = np.random.default_rng(seed)
    chosen = [[slipping[i] for i in random.choice(len(slipping), SLIPPING, replace=False)] for _ in range(draws)]
    with ProcessPoolExecutor(jobs) as pool:
        low, middle, high = np.transpose([*pool.map(learned, chosen)])
    print(f"  {draws} draws of {SLIPPING} (seed {seed}): medians from {middle.min():.3f} to {middle.max():.3f}")
    off = abs(float(np.median(middle)) - FRICTION)
    good = tell(f"sliding friction identified, the median of {draws} draws: off {FRICTION} by", off, "<=", 0.03)
    holds = float(((low <= FRICTION) & (high >= FRICTION)).sum())
    return good & tell(f"intervals of {draws} that hold {FRICTION}", holds, ">=", 0.9 * draws)


def draw(pushes: list[Push], path: Path) -> None:
    """Draw how far each push slipped over its margin, with sliding and with tabulated friction."""
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    sizes = np.array([p.size for p in pushes])
    of = {"kept": (sizes < 1.0, ARRIVED), "between": ((sizes >= 1.0) & (sizes <= 2.0), "#7d8794")}
    of["clear slip"] = (sizes > 2.0, MISSED)
    panels = {FRICTION: "sliding friction, 0.35", 0.95: "tabulated friction, 0.95"}
    for axes, (friction, title) in zip(figure.subplots(1, 2, sharey=True), panels.items(), strict=True):
        values = np.array([p.margin(friction) for p in pushes])
        for name, (rows, colour) in of.items():
            axes.scatter(values[rows], sizes[rows], s=12, color=colour, alpha=0.7, linewidths=0, label=name)
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.axvline(SURE, color="black", linewidth=0.8, linestyle="--")
        axes.set(yscale="log", xlabel="predicted margin", title=title, xlim=(-1.0, 0.45))
        wrong, all_ = int(((sizes > 2.0) & (values > SURE)).sum()), int((values > SURE).sum())
        told = f"{wrong} of {all_} above {SURE}\nslip clearly"
        axes.text(0.99, 0.97, told, ha="right", va="top", transform=axes.transAxes)
    figure.axes[0].set_ylabel("measured slip, 1 = 1.5 mm or 1 deg")
    figure.axes[0].legend(loc="lower left")
    figure.savefig(path, dpi=110)


def main() -> int:
    asked = options(__doc__, seed=58, draws=20, jobs=1, plot=Path)
    pushes = read()
    slides(pushes)
    good = margins(pushes)
    if asked.plot:
        draw(pushes, asked.plot)
    if asked.draws:
        good &= identified(pushes, asked.seed, asked.draws, asked.jobs)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
