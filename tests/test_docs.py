"""What README and docs say is so: commands run, code runs, options, links, pictures and public names exist."""

import ast
import contextlib
import importlib
import io
import re
import shlex
import shutil
from importlib.util import find_spec
from pathlib import Path

import click
import pytest
from PIL import Image

import pushplan
from pushplan.cli import main as cli
from pushplan.cli.main import main
from pushplan.scenario.file import load_scenario
from pushplan.util.names import PLANNERS, STABLE_SETS

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
SET_UP = {"python3 -m venv .venv", ". .venv/bin/activate", "pip install -e ."}
"""Lines that set an environment up: what .ci/run and whoever runs this test have done."""


def _id(page: Path) -> str:
    return page.stem


def _blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)


def _run(line: str) -> None:
    """Run a line of shell that is a `pushplan` command, perhaps with its output in a file.

    A plan is not improved for as long as its limit allows: what searches do with their time is tested elsewhere.
    """
    command, _, target = line.partition(" > ")
    if command.startswith("pushplan plan ") and "--first" not in command:
        command += " --first"
    if "--physics" in command and find_spec("mujoco") is None:  # README's set-up leaves the extras out
        return
    if find_spec("rosbags") is None:
        command = re.sub(r" --ros2 \S+", "", command)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(shlex.split(command)[1:]) == 0, line
    if target:
        Path(target).write_text(out.getvalue())


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that pages may speak of before they have made one."""
    log = tmp_path_factory.mktemp("recorded") / "run.mcap"
    pushplan.run(load_scenario("free-space"), log=log, first=True)
    return log


@pytest.mark.parametrize("page", PAGES, ids=_id)
def test_every_command_and_all_code_run_in_the_order_of_the_page(
    page: Path, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
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
        for line in block.splitlines():
            if line.startswith("pushplan "):
                _run(line)
            else:
                assert line in SET_UP or page.stem in ("README", "contributing"), line
    space: dict[str, object] = {}
    for block in _blocks(page, "python"):
        exec(compile(block, page.name, "exec"), space)


def test_the_code_that_needs_a_physics_engine_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    (block,) = _blocks(ROOT / "docs" / "will-it-hold.md", "py")
    exec(compile(block, "will-it-hold.md", "exec"), {})


@pytest.mark.parametrize("page", PAGES, ids=_id)
def test_every_command_that_is_named_exists_with_its_options(page: Path) -> None:
    for words in re.findall(r"`pushplan ([^`]+)`", page.read_text("utf-8")):
        command, *rest = words.replace("[", " ").replace("]", " ").split()
        if command.startswith("--"):
            assert command in ("--version", "--help")
            continue
        assert command in cli.COMMANDS | cli.MORE, words
        options = re.findall(r"(?<!\S)--?[a-z][a-z0-9-]*", " ".join(rest))
        assert set(options) <= _options(command), words


def _options(command: str) -> set[str]:
    found = cli.pushplan.get_command(click.Context(cli.pushplan), command)
    assert found is not None
    return {"-h", "--help", *(word for param in found.params for word in param.opts)}


@pytest.mark.parametrize("page", PAGES, ids=_id)
def test_links_and_pictures_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text("utf-8")):
        if not target.startswith(("https://", "#")):
            assert (page.parent / target).is_file(), target


def test_pictures_show_the_present_scenarios_and_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    """`docs/refresh.py` and `docs/screens.py` make them and write a hash of what they show into them."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    refresh = importlib.import_module("refresh")
    screens = dict.fromkeys(("player.png", "view.png"), "two-crates.png")
    pictures = {path.name for path in (ROOT / "docs").glob("*.png")}
    assert pictures == refresh.PICTURES.keys() | screens.keys()
    present = {name: refresh.content(name) for name in refresh.PICTURES}
    for name in sorted(pictures):
        with Image.open(ROOT / "docs" / name) as image:
            assert image.info.get("Content") == present[screens.get(name, name)], name


def test_the_run_on_the_index_is_played_by_the_present_player() -> None:
    """`python docs/refresh.py two-crates.png` makes the page anew."""
    page = (ROOT / "docs" / "_static" / "two-crates.html").read_text("utf-8")
    player = (ROOT / "logging" / "player.html").read_text("utf-8")
    _, _, script = player.partition("@RUN@")
    assert page.endswith(script)
    assert len(page) < 100_000


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


def test_the_steps_are_a_scenario_and_its_mistake_is_told_as_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / "own-scenario.md"
    steps = "".join(_blocks(page, "yaml"))
    assert (ROOT / "docs" / "mine.yaml").read_text() == steps  # the whole file, to copy
    assert len(re.findall(r"^## \d+\. ", page.read_text("utf-8"), re.MULTILINE)) == 10
    Path("mine.yaml").write_text(steps.replace("width: 0.70", "widht: 0.70"))
    assert main(["check", "mine.yaml"]) == 2
    assert _blocks(page, "text")[0].strip() in capsys.readouterr().err


@pytest.mark.parametrize("script", sorted((ROOT / "benchmarks").glob("*.py")), ids=_id)
def test_what_a_benchmark_imports_of_the_project_is_there(script: Path) -> None:
    """Nothing else runs them, and a name that has moved would show when somebody wants figures."""
    for node in ast.walk(ast.parse(script.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pushplan"):
            module = importlib.import_module(node.module or "")
            for name in node.names:
                found = hasattr(module, name.name) or find_spec(f"{node.module}.{name.name}")
                assert found, f"{node.module} has no {name.name}"
