"""Pictures: they show the execution in every format with the same bytes each time, without overlaps."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Patch, there
from kinds import FAST, KINDS, made
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from pushplan.drawing import PICTURE_SUFFIXES, palette
from pushplan.drawing import figure as plot_figure
from pushplan.drawing.estimates import plot_estimates
from pushplan.drawing.plans import plot_plan, plot_scenario
from pushplan.drawing.scene import PATH_SPACING, Scene
from pushplan.drawing.sets import plot_stable_sets
from pushplan.drawing.trials import plot_trials
from pushplan.geometry import se2
from pushplan.mechanics.chain import Drive
from pushplan.planner import plan
from pushplan.plans.execution import TrialEnd
from pushplan.plans.plan import Plan
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.parts import Workspace
from pushplan.sets.named import stable_set
from pushplan.sim.identify.measured_push import Estimate
from pushplan.sim.identify.unknowns import Unknown

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
PUSHES = KINDS[:3]


@pytest.fixture(scope="module")
def plans() -> dict[str, Plan]:
    return {kind: made(kind).plan for kind in PUSHES}


def test_margins_have_one_colour_each_on_a_fixed_scale() -> None:
    for margin, colour in palette.MARGINS:
        assert palette.margin_colour(margin) == colour
    assert palette.margin_colour(-1.0) == palette.margin_colour(0.0) == palette.SLIPS
    assert palette.margin_colour(0.9) == palette.margin_colour(0.2)
    assert palette.margin_colour(float("nan")) is None
    assert len({palette.margin_colour(0.01 * k) for k in range(21)}) == 21


@pytest.mark.parametrize("kind", PUSHES)
def test_the_path_shows_the_margins_of_pushes_only(kind: str, plans: dict[str, Plan]) -> None:
    plan = plans[kind]
    scene, execution = Scene.of(plan.scenario, plan), there(plan.execution)
    assert [line.kind for line in scene.lines] == [segment.kind for segment in plan.segments]
    for line, segment in zip(scene.lines, plan.segments, strict=True):
        assert np.isnan(line.margins).all() == (not segment.pushes)
        assert line.load == (segment.load.names if segment.pushes and segment.load is not None else ())
        np.testing.assert_allclose(
            line.points[[0, -1]], segment.path.poses_at([0.0, segment.path.cost])[:, :2], atol=1e-6
        )
        assert np.hypot(*np.diff(line.points, axis=0).T).max() < 2.0 * PATH_SPACING
    assert min(np.nanmin(line.margins) for line in scene.lines if line.pushes) == execution.min_margin
    assert [rest.names for rest in scene.rests] == [push.load.names for push in plan.pushes if push.load is not None]
    for rest, push in zip(scene.rests, plan.pushes, strict=True):
        for body, pose in zip(scene.bodies, rest.poses, strict=True):
            np.testing.assert_allclose(se2.pose_error(pose, push.after.get(body.name, push.path.end)), 0.0, atol=1e-6)
    untimed = Scene.of(plan.scenario, replace(plan, execution=None))
    assert [len(rest.names) for rest in untimed.rests] == [len(rest.names) for rest in scene.rests]
    np.testing.assert_allclose(untimed.rests[-1].poses[:, :2], scene.rests[-1].poses[:, :2], atol=1e-6)


@pytest.mark.parametrize("suffix", PICTURE_SUFFIXES)
def test_a_plan_is_drawn_in_every_form_with_the_same_bytes_each_time(
    suffix: str, plans: dict[str, Plan], tmp_path: Path
) -> None:
    files = [tmp_path / f"{i}{suffix.upper() if i else suffix}" for i in range(2)]
    for file in files:
        plot_plan(plans["push"], file)
    first, second = (file.read_bytes() for file in files)
    assert first.startswith(MAGIC[suffix])
    assert first == second


@pytest.mark.parametrize("kind", [*KINDS, "long words", "wide", "tall"])
def test_nothing_in_a_picture_covers_its_key_or_spills(kind: str, tmp_path: Path, monkeypatch: Patch) -> None:
    spaces = {"wide": Workspace(0.0, 4.0, 0.0, 0.5), "tall": Workspace(0.0, 0.5, 0.0, 4.0)}
    figures = _kept_figures(monkeypatch)
    run = made(kind if kind in KINDS else "unsolved" if kind == "long words" else "push")
    plan, name = run.plan, run.scenario.name
    if kind == "long words":
        plan, name = replace(plan, reason="a passage is too narrow for the chain by 31 mm " * 3), 20 * name
    scenario = replace(plan.scenario, name=name, workspace=spaces.get(kind, plan.scenario.workspace))
    plot_plan(replace(plan, scenario=scenario), tmp_path / "p.png", run.execution, run.events)
    plot_scenario(scenario, tmp_path / "s.png")
    for figure in figures:
        _assert_nothing_covered(figure)
        sizes = [float(text.get_fontsize()) for text in figure.findobj(Text) if isinstance(text, Text)]
        assert min(sizes) >= 6.0


def test_the_title_of_a_partial_plan_counts_all_goals(tmp_path: Path, monkeypatch: Patch) -> None:
    figures, scenario = _kept_figures(monkeypatch), scenario_from_text(FAST["partial"])
    found = plan(scenario, first=True, seed=1, time_limit=60.0)
    plot_plan(found, tmp_path / "p.png")
    assert found.undelivered.keys() == {"stuck"}
    texts = {text.get_text() for text in figures[0].findobj(Text) if isinstance(text, Text)}
    assert "one-is-stuck: partial plan, 2 of 3 delivered" in texts


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("drive", ["omnidirectional", "differential", "car"])
def test_the_legend_of_stable_sets_covers_nothing_and_is_not_cut_off(
    count: int, drive: str, plans: dict[str, Plan], tmp_path: Path, monkeypatch: Patch
) -> None:
    figures, chain = _kept_figures(monkeypatch), plans["push"].scenario.chain
    if drive != "omnidirectional":
        wheels = Drive(drive, np.array([-0.3, 0.0, 0.0]), 0.8 if drive == "car" else 0.0)
        chain = replace(chain, pusher=replace(chain.pusher, drive=wheels))
    plot_stable_sets(chain, [stable_set(chain, "ecof")] * count, tmp_path / "s.png")
    _assert_nothing_covered(figures[0])


def test_intervals_of_estimates_lie_at_their_shares_of_the_searched_range(tmp_path: Path, monkeypatch: Patch) -> None:
    figures = _kept_figures(monkeypatch)
    plain = Unknown("border", 0, "load on the border of near", 0.2, 1.2)
    log = Unknown("contact_friction", 0, "contact friction pusher-near", 0.01, 1.0, True)
    told = [
        Estimate(plain, 0.3, 0.5, 0.7, True),
        Estimate(log, 0.1, 0.1, 0.1, True),
        Estimate(log, 0.01, 0.1, 1, False),
    ]
    plot_estimates(told, tmp_path / "e.png")
    (axes,) = figures[0].axes
    spans = [(bar.get_y() + 0.25, bar.get_x(), bar.get_width()) for bar in axes.patches if isinstance(bar, Rectangle)]
    inside = [span for span in spans if span[2] < 1.0]
    assert np.allclose(inside, [(0.0, 0.1, 0.4), (1.0, 0.5, 0.0)])
    assert "not determined" in {text.get_text() for text in axes.texts}
    _assert_nothing_covered(figures[0])


def _kept_figures(monkeypatch: Patch) -> list[Figure]:
    figures: list[Figure] = []

    class Kept(Figure):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            figures.append(self)

    monkeypatch.setattr(plot_figure, "Figure", Kept)
    return figures


def _assert_nothing_covered(figure: Figure) -> None:
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    below = [artist.get_window_extent(renderer) for artist in (*figure.legends, *figure.texts)]
    boxes = [box for axes in figure.axes if (box := axes.get_tightbbox(renderer)) is not None]
    assert figure.legends
    assert not any(one.overlaps(other) for one, other in combinations(below, 2))
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert not any(one.overlaps(box) for one in below for box in boxes)
    for box in [*below, *boxes]:
        assert box.x0 >= 0.0
        assert box.y0 >= 0.0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1


def test_a_picture_without_a_plan_shows_the_tree_the_nearest_path_and_the_reason(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    figures, unsolved = _kept_figures(monkeypatch), made("unsolved").plan
    plot_plan(unsolved, tmp_path / "why.png")
    floor = figures[0].axes[0]
    (tree,) = [one for one in floor.collections if isinstance(one, LineCollection)]
    np.testing.assert_allclose(np.array(tree.get_segments()), unsolved.tree[:, :, :2])
    (line,) = [one for one in floor.lines if one.get_color() == palette.NEAREST]
    np.testing.assert_allclose(
        np.asarray(line.get_xydata())[-1], there(unsolved.nearest).segments[0].path.end[:2], atol=1e-9
    )
    told = " ".join(text.get_text().replace("\n", " ") for text in figures[0].texts)
    for sentence in unsolved.why_not:
        assert sentence.strip() in told


def test_the_picture_of_trials_counts_arrivals_and_outliers(
    plans: dict[str, Plan], tmp_path: Path, monkeypatch: Patch
) -> None:
    """Of four samples, the last ends 5 mm off."""
    figures, scenario = _kept_figures(monkeypatch), plans["push"].scenario
    places = se2.compose(scenario.goal.pose_chain, scenario.chain.places)
    off, errors, nan = np.array([0.0, 0.005, 0.0]), np.zeros((len(places), 2)), float("nan")
    ends = [TrialEnd(k, k < 3, False, errors, places + (k == 3) * off, "", "", nan, "", (nan, nan)) for k in range(4)]
    plot_trials(plans["push"], ends, tmp_path / "t.png")
    floor, close = figures[0].axes
    assert "3 of 4 arrive" in floor.get_title(loc="left")
    assert "1 of 4 outside" in close.get_title(loc="left")
    missed = next(line for line in close.lines if line.get_color() == palette.MISSED)
    np.testing.assert_allclose(np.asarray(missed.get_xydata()), [[0.0, 5.0]], atol=1e-9)
    _assert_nothing_covered(figures[0])


def test_lines_of_a_picture_do_not_begin_with_a_unit() -> None:
    sentence = "an object aside by 3.7 mm or turned by 1.6 deg; its load by 21 %"
    for letters in range(10, 60):
        lines = plot_figure.broken(sentence, letters)
        assert " ".join(lines) == sentence
        assert not [line for line in lines if line.startswith(("mm", "deg;", "%"))]
