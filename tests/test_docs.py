"""README, docs and examples are correct: commands and code run, options, links and public names exist."""

import ast
import contextlib
import importlib
import io
import json
import re
import runpy
import shlex
import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import numpy as np
import pytest
from conftest import Captured, Patch, identify_roughly, there
from PIL import Image
from rough import first_plans, rough_identification, slow_controllers

import pushplan
from pushplan.cli import main as cli
from pushplan.cli.main import main
from pushplan.scenario.file import example_text, load_scenario
from pushplan.sim.identify.identify import identify_pushes
from pushplan.sim.identify.measured_push import Identification
from pushplan.util.names import PLANNERS, STABLE_SETS

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
OPTIONAL = ("mujoco", "nanobind", "building")
"""Imports of benchmarks that an installation without extras or sources lacks."""
SET_UP = {"python3 -m venv .venv", ". .venv/bin/activate", "pip install -e ."}
"""Lines that set up an environment, as .ci/run or the user already has."""


def _id(page: Path) -> str:
    return page.stem


def _blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)


def _run(line: str, recorded: bool) -> str:
    """Run a shell line with a `pushplan` command, also with redirected output; return its output."""
    command, _, target = line.partition(" > ")
    command = re.sub(r"--samples \d+", "--samples 3", command)
    if not recorded and command.startswith("pushplan plan ") and " -o " not in command:
        command += " --no-log"
    if "--physics" in command and find_spec("mujoco") is None:  # README's set-up leaves the extras out
        return ""
    if find_spec("rosbags") is None:
        command = re.sub(r" --ros2 \S+", "", command)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(shlex.split(command)[1:]) == 0, line
    if target:
        Path(target).write_text(out.getvalue())
    return out.getvalue()


@pytest.fixture
def _quick(monkeypatch: Patch) -> Iterator[None]:
    """Make searches short, because only the form of the output is checked."""
    rough_identification(monkeypatch)
    monkeypatch.setattr("pushplan.drawing.figure._DPI", 50)
    with slow_controllers(), first_plans():
        yield


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a run for pages that use one before they make one."""
    log = tmp_path_factory.mktemp("recorded") / "run.mcap"
    pushplan.run(load_scenario("free-space"), log=log, first=True, time_limit=600.0)
    return log


@pytest.mark.usefixtures("_quick")
@pytest.mark.parametrize("page", PAGES, ids=_id)
def test_every_command_and_all_code_run_in_the_order_of_the_page(
    page: Path, recorded: Path, tmp_path: Path, monkeypatch: Patch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    _identify_once(monkeypatch)
    shutil.copy(recorded, "run.mcap")
    if page.stem == "own-scenario":
        Path("mine.yaml").write_text("".join(_blocks(page, "yaml")))
    if page.stem == "several-pushes":
        for name, block in zip(
            ("bring-it-home.yaml", "change-places.yaml", "row.yaml"), _blocks(page, "yaml"), strict=True
        ):
            Path(name).write_text(block)
    if page.stem == "from-a-map":
        shutil.copytree(ROOT / "examples" / "office", ".", dirs_exist_ok=True)
        assert _blocks(page, "yaml") == [Path("push.yaml").read_text().partition("\n")[2]]
    if page.stem == "gallery":
        for folder in ("docs/gallery", "examples"):
            shutil.copytree(ROOT / folder, folder)
    for block in _blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            if line.startswith("pushplan "):
                print(_run(line, page.stem == "logs"))
            else:
                assert line in SET_UP or page.stem in ("README", "contributing"), line
    if page.stem == "closed-loop":
        _leave_measurements()
    space: dict[str, object] = {}
    for block in _blocks(page, "python"):
        if "physics" not in block or find_spec("mujoco") is not None:
            exec(compile(block, page.name, "exec"), space)
    for command in re.findall(r"^\$ (pushplan (?:.*\\\n)*.*)", page.read_text("utf-8"), flags=re.MULTILINE):
        print(_run(command.replace("\\\n", " "), page.stem == "closed-loop"))
    printed = capsys.readouterr().out
    _require_plain(printed)
    if page.stem != "README":  # its output is compared below
        assert _labels("\n".join(_blocks(page, "text"))) <= _labels(printed)


def _identify_once(patch: Patch) -> None:
    """Identify roughly, and reuse the result of the first identification in all others of a page."""
    identify_roughly(patch)
    found = list[Identification]()

    def identified(*args: Any, **kwargs: Any) -> Identification:
        if not found:
            found.append(identify_pushes(*args, **kwargs))
        return found[0]

    for module in ("pushplan.identify", "pushplan.sim.identify.identify"):
        patch.setattr(importlib.import_module(module), "identify_pushes", identified)


def _leave_measurements() -> None:
    """Write logs and a table of measured poses, like those of a user who identifies friction."""
    for day in ("monday", "tuesday"):
        shutil.copy("worst.mcap", f"{day}.mcap")
    Path("mine.yaml").write_text(example_text("two-crates"))
    scenario = load_scenario("mine.yaml")
    report = pushplan.simulate(
        pushplan.plan(scenario, first=True, time_limit=600.0), pushplan.World.from_scenario(scenario)
    )
    poses = np.concatenate([report.poses[:, None], report.objects], axis=1)[::20]
    table = np.column_stack([report.t[::20], poses.reshape(len(poses), -1)])
    np.savetxt("push-1.csv", table, delimiter=",", header="t and poses")


def _labels(output: str) -> set[str]:
    """Return the labels before values in output: two blanks, a label, blanks; with numbers replaced."""
    found = re.findall(r"^  (\S+(?: \S+)*)  +\S", output, re.MULTILINE)
    return {re.sub(r"\d[\d.]*", "#", label) for label in found}


def _require_plain(printed: str) -> None:
    """Refuse output with Python internals: an uncalled method, an object without a text."""
    assert not re.search(r"<(bound )?(method|function)\b|<\S+ object at 0x|np\.float64\(", printed), printed


@pytest.mark.usefixtures("_quick")
@pytest.mark.parametrize("notebook", sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")), ids=_id)
def test_every_cell_of_a_notebook_runs_and_prints(
    notebook: Path, tmp_path: Path, monkeypatch: Patch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    display = ModuleType("IPython.display")
    display.__dict__["Image"] = lambda name, width: Path(name).read_bytes()
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.syspath_prepend(tmp_path)
    space: dict[str, object] = {}
    for cell in json.loads(notebook.read_text("utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            exec(compile(source, notebook.name, "exec"), space)
            printed = capsys.readouterr().out
            assert bool(printed) == ("print(" in source or "main(" in source), source
            _require_plain(printed)


@pytest.mark.parametrize("page", PAGES, ids=_id)
def test_every_named_command_exists_with_its_options(page: Path) -> None:
    for words in re.findall(r"`pushplan ([^`]+)`", page.read_text("utf-8")):
        command, *rest = words.replace("[", " ").replace("]", " ").split()
        if command.startswith("--"):
            assert command in ("--version", "--help")
            continue
        assert command in cli.COMMANDS | cli.MORE, words
        options = re.findall(r"(?<!\S)--?[a-z][a-z0-9-]*", " ".join(rest))
        found = there(cli.pushplan.get_command(click.Context(cli.pushplan), command))
        assert set(options) <= {"-h", "--help", *(word for param in found.params for word in param.opts)}, words


@pytest.mark.parametrize("page", PAGES, ids=_id)
def test_links_and_pictures_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text("utf-8")):
        if not target.startswith(("https://", "#")):
            package = Path(there(pushplan.__file__)).parent  # beside an installed wheel the only sources
            places = (parent / target for parent in (page.parent, package.parent, package))
            assert any(place.is_file() for place in places), target


def test_pictures_show_the_current_scenarios_and_plans(monkeypatch: Patch) -> None:
    """`docs/refresh.py` and `docs/screens.py` draw them and write a hash of their contents into them. Only those with
    short planning times are checked.
    """
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    refresh = importlib.import_module("refresh")
    pictures = {path.name for path in (ROOT / "docs").glob("*.png")}
    assert pictures == refresh.PICTURES.keys() | {"player.png", "view.png", "real-pushes.png"}
    searched = {name for name, command in refresh.PICTURES.items() if "--iterations" in command}
    for name in refresh.PICTURES.keys() - searched - {"pencils.png"}:
        with Image.open(ROOT / "docs" / name) as image:
            assert image.info.get("Content") == refresh.content(name), name


def test_all_public_names_are_in_the_reference() -> None:
    reference = (ROOT / "docs" / "api.md").read_text("utf-8")
    named = set(re.findall(r"^   pushplan\.(\w+)$", reference, flags=re.MULTILINE))
    assert named == set(vars(pushplan)["__all__"]) - {"__version__"}


def test_all_commands_planners_and_sets_are_described() -> None:
    texts = {page.stem: page.read_text("utf-8") for page in PAGES}
    for command in cli.COMMANDS | cli.MORE:
        assert f"`pushplan {command}" in texts["README" if command in cli.COMMANDS else "start"], command
    assert set(re.findall(r"^\| `(.*?)` \|", texts["mechanics"], re.MULTILINE)) == {*STABLE_SETS}
    rows = re.findall(r"^\| (`.*?) \|", texts["planners"], re.MULTILINE)
    assert {word for row in rows for word in re.findall(r"`([\w-]+)`", row)} == {*PLANNERS}


def test_the_tutorial_s_scenario_loads_and_its_mistake_gives_the_printed_message(
    tmp_path: Path, monkeypatch: Patch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / "own-scenario.md"
    steps = "".join(_blocks(page, "yaml"))
    assert (ROOT / "docs" / "mine.yaml").read_text() == steps  # the whole file, to copy
    assert len(re.findall(r"^## \d+\. ", page.read_text("utf-8"), re.MULTILINE)) == 10
    Path("mine.yaml").write_text(steps.replace("width: 0.70", "widht: 0.70"))
    assert main(["check", "mine.yaml"]) == 2
    assert _blocks(page, "text")[0].strip() in capsys.readouterr().err


@pytest.mark.parametrize("script", sorted((ROOT / "benchmarks").rglob("*.py")), ids=_id)
def test_imports_of_every_benchmark_exist(script: Path, monkeypatch: Patch) -> None:
    """No other test runs them, so a moved name would be noticed too late."""
    for folder in ("benchmarks", "examples/harada2006"):
        monkeypatch.syspath_prepend(str(ROOT / folder))
    for node in ast.walk(ast.parse(script.read_text("utf-8"))):
        home = (getattr(node, "module", None) or "").partition(".")[0]
        if isinstance(node, ast.ImportFrom) and home not in {*sys.stdlib_module_names, *OPTIONAL}:
            module = importlib.import_module(node.module or "")
            for name in node.names:
                found = hasattr(module, name.name) or find_spec(f"{node.module}.{name.name}")
                assert found, f"{node.module} has no {name.name}"


README = ROOT / "README.md"


def _shape(output: str) -> str:
    """Return output with every number replaced, with bounds marked, which is the same in every run."""
    output = output.replace("at least ", "")  # the search of the robustness ends there
    output = re.sub(
        r"contact [\w-]+", "contact", output
    )  # the contact with the least margin depends on the progress of the search
    return re.sub(r"[-+]?\d[\d.]*(e[-+]\d+)?( ms| s|\b)", "#", output)


def test_the_first_command_prints_the_readme_s_output(tmp_path: Path, monkeypatch: Patch, capsys: Captured) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(_blocks(README, "sh")[0].rpartition("/pushplan ")[2])) == 0
    printed, shown = capsys.readouterr().out.splitlines(), _blocks(README, "text")[0].splitlines()
    assert printed[0] == shown[0]
    assert [line.split("  ")[:2] for line in printed] == [line.split("  ")[:2] for line in shown]
    assert [_shape(line) for line in printed] == [_shape(line) for line in shown]
    assert (tmp_path / "run.mcap").exists()
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_the_documented_error_message_is_the_printed_one(
    tmp_path: Path, monkeypatch: Patch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mine"]) == 0
    file = Path("mine.yaml")
    file.write_text(file.read_text().replace("  width: ", "  widht: "))
    assert main(["check", "mine.yaml"]) == 2
    assert capsys.readouterr().err == _blocks(README, "text")[1]


SCRIPTS = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.usefixtures("_quick")
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_runs_and_prints(script: Path, tmp_path: Path, monkeypatch: Patch, capsys: Captured) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(script), run_name="__main__")
    assert capsys.readouterr().out.strip()


EXAMPLE = ROOT / "examples" / "harada2006"


@pytest.mark.skipif(
    find_spec("mujoco") is None, reason="MuJoCo is not installed; the extra pushplan[physics] brings it"
)
def test_the_paper_s_figures_are_made(tmp_path: Path, monkeypatch: Patch, capsys: Captured) -> None:
    """All centres of rotation are counted; the two blocks stay together on the path to the goal."""
    monkeypatch.syspath_prepend(str(EXAMPLE))
    monkeypatch.setattr(sys, "argv", ["make_figures.py", "--out", str(tmp_path), "--cors", "2"])
    runpy.run_path(str(EXAMPLE / "make_figures.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["fig11", "fig12", "fig6", "fig7", "fig9"]
    assert all(path.stat().st_size > 1_000 for path in tmp_path.iterdir())
    counts = [line.split()[-2:] for line in printed.splitlines() if line.startswith("Algorithm 1")]
    held, moved = np.array(counts, dtype=int).reshape(2, 2, 2).swapaxes(0, 2)
    assert (held.sum() + moved.sum()) == 4
    assert moved[0].sum() == held[1].sum() == 0
    assert printed.count(" held: ") == 2
    assert " moved from " not in printed
