"""Pictures: right content, every format, the same bytes each time, nothing covered."""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import pushplan
from pushplan.drawing import figure as plot_figure
from pushplan.drawing.format import PICTURE_SUFFIXES, PlotError, check_picture_path
from pushplan.drawing.run import plot_plan
from pushplan.drawing.sets import plot_stable_sets
from pushplan.drawing.world import draw_by_margin, draw_surroundings, draw_sweep, view_box
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.friction_cone import friction_cone
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.execution import Execution
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.result import PlanResult
from pushplan.plans.robustness import Robustness
from pushplan.scenario.model import CircleObstacle, Goal, PolygonObstacle, Scenario, Workspace
from pushplan.sets.cor_window import default_window
from pushplan.sets.named import stable_set
from pushplan.sim.rigid import simulate_rigid
from pushplan.util.arrays import FloatArray

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


@pytest.fixture(scope="module")
def chain(make_chain: Any) -> Chain:
    made: Chain = make_chain.boxes(2)
    return made


@pytest.fixture(scope="module")
def path() -> PushPath:
    twists = np.array([[1.0, 0.0, 0.0], [1.0, -0.1, 1.0], [1.0, 0.0, 0.0]])
    return PushPath(np.zeros(3), twists / cost_rate(twists)[:, None], np.array([0.4, 0.6, 0.3]))


@pytest.fixture(scope="module")
def scenario(chain: Chain, path: PushPath) -> Scenario:
    obstacles = (
        PolygonObstacle(np.array([[0.6, -0.4], [0.8, -0.4], [0.8, -0.2]])),
        CircleObstacle(np.array([0.2, 0.7]), 0.15),
    )
    goal = Goal(path.end, None, path.end, 0.002, 0.003)
    space = Workspace(-0.3, 1.5, -0.6, 1.2)
    return Scenario("test", Path("test.yaml"), b"", chain, 0.3, np.zeros(3), goal, space, obstacles)


@pytest.fixture(scope="module")
def plan(chain: Chain, path: PushPath) -> PlanResult:
    trajectory = time_path(path, Bounds(chain.pusher.limits))
    tree = np.zeros((0, 2, 3))
    return PlanResult(True, "", "rrt", "ecof", 1, path, trajectory, 0.01, 0.5, (), 100, 0.1, tree)


@pytest.fixture(scope="module")
def unsolved() -> PlanResult:
    tree = np.random.default_rng(0).uniform(0.0, 1.0, (50, 2, 3))
    return PlanResult(False, "no time", "rrt", "ecof", 1, None, None, None, 0.5, (), 100, None, tree)


@pytest.fixture(scope="module")
def execution(chain: Chain, plan: PlanResult, scenario: Scenario) -> Execution:
    assert plan.trajectory is not None
    return simulate_rigid(plan.trajectory, stable_set(chain, "ecof"), scenario.goal.pose_chain)


@pytest.mark.parametrize("suffix", PICTURE_SUFFIXES)
def test_a_plan_is_drawn_in_every_form_with_the_same_bytes_each_time(
    suffix: str, scenario: Scenario, plan: PlanResult, execution: Execution, tmp_path: Path
) -> None:
    files = [tmp_path / f"{i}{suffix}" for i in range(2)]
    for file in files:
        plot_plan(scenario, plan, execution, file)
    first, second = (file.read_bytes() for file in files)
    assert first.startswith(MAGIC[suffix])
    assert first == second


def test_a_plan_shows_what_it_bears(
    scenario: Scenario, plan: PlanResult, execution: Execution, tmp_path: Path
) -> None:
    bearing = replace(plan, robustness=Robustness(0.5, 0.25, 0.5, 0.01, 0.1))
    plot_plan(scenario, bearing, execution, tmp_path / "p.svg")
    assert "<!-- tolerates 50 % lower contact friction than nominal," in (tmp_path / "p.svg").read_text()


def test_a_plan_shows_its_name_numbers_and_labels(
    scenario: Scenario, plan: PlanResult, execution: Execution, tmp_path: Path
) -> None:
    plot_plan(scenario, plan, execution, tmp_path / "p.svg")
    text = (tmp_path / "p.svg").read_text()
    assert plan.trajectory is not None
    title = f"test: 1.30 m in {plan.trajectory.duration:.1f} s"
    for words in (
        title,
        "x [m]",
        "y [m]",
        "margin: the path's colour",
        "time [s]",
        "start",
        "goal",
        "obstacle",
        "swept",
    ):
        assert f"<!-- {words} -->" in text


def test_a_run_without_a_plan_shows_its_search_tree(
    scenario: Scenario, unsolved: PlanResult, tmp_path: Path
) -> None:
    plot_plan(scenario, unsolved, None, tmp_path / "p.svg")
    text = (tmp_path / "p.svg").read_text()
    assert "<!-- test: no plan -->" in text
    assert "<!-- search tree -->" in text
    assert "<!-- swept -->" not in text


@pytest.mark.parametrize("solved", [True, False])
def test_the_legend_of_a_plan_covers_nothing(
    solved: bool,
    scenario: Scenario,
    plan: PlanResult,
    unsolved: PlanResult,
    execution: Execution,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    figures = _kept_figures(monkeypatch)
    bearing = replace(plan, robustness=Robustness(0.5, 0.25, 0.5, 0.01, 0.1))
    named = replace(scenario, name="a-long-name-" * 20)
    plot_plan(named, bearing if solved else unsolved, execution if solved else None, tmp_path / "p.png")
    assert len(figures[0].texts) == solved
    _assert_nothing_covered(figures[0])


@pytest.mark.parametrize("size", [(0.5, 4.0), (4.0, 0.5)])
def test_the_legend_of_a_plan_fits_a_thin_workspace(
    size: tuple[float, float],
    scenario: Scenario,
    unsolved: PlanResult,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    figures = _kept_figures(monkeypatch)
    thin = replace(scenario, workspace=Workspace(0.0, size[0], 0.0, size[1]))
    plot_plan(thin, unsolved, None, tmp_path / "p.png")
    _assert_nothing_covered(figures[0])


@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_legend_of_stable_sets_covers_nothing(
    count: int, chain: Chain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures = _kept_figures(monkeypatch)
    plot_stable_sets(chain, [stable_set(chain, "ecof")] * count, tmp_path / "s.png")
    _assert_nothing_covered(figures[0])


def _kept_figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    figures: list[Figure] = []

    class Kept(Figure):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            figures.append(self)

    monkeypatch.setattr(plot_figure, "Figure", Kept)
    return figures


def _assert_nothing_covered(figure: Figure) -> None:
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    below = [*figure.legends, *figure.texts]
    legends = [artist.get_window_extent(renderer) for artist in below]
    boxes = [axes.get_tightbbox(renderer) for axes in figure.axes]
    assert legends
    assert not any(one.overlaps(other) for one, other in combinations(legends, 2))
    for box in boxes:
        assert box is not None
        assert not any(legend.overlaps(box) for legend in legends)
    for box in [*legends, *boxes]:
        assert box is not None
        assert box.x0 >= 0.0
        assert box.y0 >= 0.0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1


@pytest.mark.parametrize("name", ["p.jpg", "p", "p.png.gz"])
def test_another_suffix_is_refused_by_name_before_anything_is_drawn(name: str) -> None:
    with pytest.raises(PlotError, match=r"a picture ends in \.png, \.svg, \.pdf, not in "):
        check_picture_path(name)


def test_upper_case_suffixes_are_fine(chain: Chain, tmp_path: Path) -> None:
    plot_stable_sets(chain, [stable_set(chain, "ecof")], tmp_path / "S.PNG")
    assert (tmp_path / "S.PNG").read_bytes().startswith(MAGIC[".png"])


def test_the_global_drawing_state_is_not_used() -> None:
    for source in (Path(str(pushplan.__file__)).parent / "drawing").glob("*.py"):
        names = {node.name for node in ast.walk(ast.parse(source.read_text())) if isinstance(node, ast.alias)}
        assert not any("pyplot" in name for name in names), source


def test_a_friction_cone_opens_by_the_friction_angle_around_the_normal(chain: Chain) -> None:
    for contact in chain.contacts:
        apex, low, high = friction_cone(contact, contact.right, 0.5 * contact.length)
        assert np.allclose(apex, contact.right)
        for edge in (low - apex, high - apex):
            assert np.isclose(abs(edge @ contact.tangent), contact.friction * (edge @ contact.normal))
            assert edge @ contact.normal > 0.0


def test_the_default_window_holds_the_chain_and_the_tightest_turns(chain: Chain) -> None:
    stable = stable_set(chain, "ecof")
    xmin, ymin, xmax, ymax = default_window(chain, [stable])
    points = np.concatenate([chain.pusher.outline, *(obj.outline_chain for obj in chain.objects)])
    assert (points > [xmin, ymin]).all()
    assert (points < [xmax, ymax]).all()
    assert ymax > stable.turning_radii().left
    assert ymin < -stable.turning_radii().right
    for sense in (1, -1):
        assert not stable.cor_region(sense, (xmin, ymin, xmax, ymax)).is_empty


def test_obstacles_and_walls_are_drawn_where_they_are(scenario: Scenario) -> None:
    axes = Figure().add_subplot()
    draw_surroundings(axes, scenario)
    walls, polygon, circle = axes.patches
    assert _extents(walls) == pytest.approx((-0.3, -0.6, 1.5, 1.2))
    assert _extents(polygon) == pytest.approx((0.6, -0.4, 0.8, -0.2))
    assert isinstance(circle, Circle)
    assert circle.get_radius() == pytest.approx(0.15)


def test_the_swept_area_reaches_from_start_to_goal(chain: Chain, path: PushPath) -> None:
    axes = Figure().add_subplot()
    draw_sweep(axes, chain, path)
    filled = axes.patches[0].get_path()
    for pose in path.poses_at(np.linspace(0.0, path.cost, 20)):
        x, y = transform_points(pose, np.array([0.1, 0.0]))
        assert filled.contains_point((x, y))


def _extents(patch: Any) -> tuple[float, ...]:
    return tuple(patch.get_path().get_extents(patch.get_patch_transform()).extents)


def test_without_a_workspace_the_view_holds_everything(scenario: Scenario, path: PushPath) -> None:
    x0, y0, x1, y1 = view_box(replace(scenario, workspace=None), path)
    assert x0 < -0.03
    assert y0 < -0.4
    assert y1 > 0.85
    assert x1 > path.end[0]
    assert 1.0 - 1e-9 <= (x1 - x0) / (y1 - y0) <= 1.6 + 1e-9


@pytest.mark.parametrize("size", [(4.0, 0.5), (0.5, 4.0), (1.0, 1.0)])
def test_a_thin_workspace_is_shown_with_air_around_it(
    size: tuple[float, float], scenario: Scenario, path: PushPath
) -> None:
    x0, y0, x1, y1 = view_box(replace(scenario, workspace=Workspace(0.0, size[0], 0.0, size[1])), path)
    assert 1.0 - 1e-9 <= (x1 - x0) / (y1 - y0) <= 1.6 + 1e-9
    assert x0 <= 0.0 <= size[0] <= x1
    assert y0 <= 0.0 <= size[1] <= y1


def test_the_line_is_coloured_by_the_smaller_margin_of_each_piece_and_broken_where_it_jumps() -> None:
    points: FloatArray = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    line = draw_by_margin(
        Figure().add_subplot(), points, np.array([0.3, 0.29, 0.1, 0.12]), {"color": "white"}
    )
    assert np.allclose(np.asarray(line.get_array()), [0.29, 0.1])
    assert [segment[0, 0] for segment in line.get_segments()] == [0.0, 2.0]
    assert line.get_clim() == (0.0, 0.3)


def test_a_picture_without_a_plan_shows_the_nearest_path_and_says_why(
    scenario: Scenario, plan: PlanResult, tmp_path: Path
) -> None:
    said = "the passage is too narrow for the chain by three millimetres"
    unsolved = replace(
        plan, solved=False, reason=said, path=None, trajectory=None, approximate_path=plan.path
    )
    plot_plan(scenario, replace(unsolved, approximate_error=(0.25, 0.5)), None, tmp_path / "why.svg")
    drawn = (tmp_path / "why.svg").read_text()
    assert "#b45f06" in drawn
    told = " ".join(re.findall("<!-- (.*) -->", drawn))
    for words in (
        said,
        "the nearest path ends 0.250 m and 28.6 deg from the goal",
        "no plan",
        "nearest path",
    ):
        assert words in told
