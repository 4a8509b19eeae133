"""The package: its public interface, cost of its import, its layers, and its vocabulary."""

import ast
import base64
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import fields
from functools import cache
from graphlib import TopologicalSorter
from inspect import CO_OPTIMIZED, signature
from pathlib import Path
from types import FrameType
from typing import Any

import mcap.writer
import pytest
import ruckig
import shapely
import yaml
from click.testing import CliRunner
from conftest import Captured, there

import pushplan
from pushplan.bench import store
from pushplan.bench.schema import SUITE_FORMAT
from pushplan.cli.main import COMMANDS, MORE, main
from pushplan.cli.main import pushplan as command_line
from pushplan.logging import metadata, tables
from pushplan.plans.plan import PLAN_FORMAT
from pushplan.scenario.file import example_text
from pushplan.util.names import SCENARIO_FORMAT

HEAVY = ("ompl", "matplotlib", "mcap", "shapely", "pydantic", "scipy", "ruckig", "numpy")
ROOT = Path(__file__).parents[1]


def test_functions_take_precedence_over_modules_of_the_same_name() -> None:
    code = "from pushplan.run import run\nimport pushplan, pushplan.run\nassert callable(pushplan.run), pushplan.run"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def _modules_after(code: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("code", ["import pushplan", "from pushplan.cli.main import main; main(['--help'])"])
def test_importing_the_package_and_its_help_load_nothing_heavy(code: str) -> None:
    assert not _modules_after(code).intersection(HEAVY)


def test_a_command_loads_only_what_it_needs(tmp_path: Path) -> None:
    log = str(tmp_path / "run.mcap")
    drawing = {"matplotlib", "numpy.ma", "scipy", "pandas", "jinja2"}
    for words, spared in (
        (["check", "two-crates"], {"ompl", "mcap", "ruckig", "google", "pushplan.plans.plan", *drawing}),
        (["plan", "two-crates", "--first", "-o", log, "--no-page"], drawing),
    ):
        loaded = _modules_after(f"from pushplan.cli.main import main; assert main({words}) == 0")
        assert "pushplan.scenario.file" in loaded
        assert not loaded & spared


def test_objects_in_a_notebook_show_a_line_or_a_picture() -> None:
    run = pushplan.run("one-box", first=True, time_limit=60.0, log=False)
    plan = run.plan
    lines = [repr(one) for one in (run, plan, plan.trajectory, plan.scenario.chain)]
    assert all(len(line) < 120 and "\n" not in line for line in lines), lines
    picture = there(pushplan.plot_plan(plan))
    assert picture.startswith(b"\x89PNG\r\n")
    assert (picture._repr_png_(), repr(picture)) == (bytes(picture), f"<Picture of {len(picture)} bytes>")
    assert base64.b64encode(picture).decode() in plan._repr_html_()


def test_help_names_every_option_of_planning(tmp_path: Path) -> None:
    for function in (pushplan.plan, pushplan.run, pushplan.Planner):
        names = list(signature(function).parameters)
        assert names[-len(fields(pushplan.PlanSettings)) :] == [one.name for one in fields(pushplan.PlanSettings)]
        assert "options" not in names
        assert "0x" not in str(signature(function))
    file = tmp_path / "mine.yaml"
    file.write_text(example_text("one-box"))
    plans = [pushplan.plan(source, first=True, time_limit=60.0) for source in (file, str(file), "one-box")]
    assert plans[0].cost == plans[1].cost == plans[2].cost
    with pytest.raises(pushplan.ScenarioError, match="cannot read the file"):
        pushplan.plan("nowhere.yaml")


def test_documented_formats_and_python_versions_match_the_code() -> None:
    rows = re.findall(r"^\| [^|]+ \| `?([\w/-]+)`? \|", (ROOT / "docs" / "api.md").read_text(), re.MULTILINE)
    numbers = (SCENARIO_FORMAT, SUITE_FORMAT, metadata.FORMAT, store.FORMAT, tables.FORMAT, PLAN_FORMAT)
    assert rows[-6:] == [str(number) for number in numbers]
    with (ROOT / "pyproject.toml").open("rb") as file:
        document = tomllib.load(file)
    words = [text.rpartition(" :: ")[2] for text in document["project"]["classifiers"]]
    pythons = [word for word in words if re.fullmatch(r"3\.\d+", word)]
    assert [text[2:].partition("-")[0] for text in document["tool"]["cibuildwheel"]["build"].split()] == [
        python.replace(".", "") for python in pythons
    ]
    if (ROOT / ".github").is_dir():  # the tests can run without the sources
        workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text())
        assert workflow["jobs"]["tests"]["strategy"]["matrix"]["python"] == pythons
        assert f'versions="{" ".join(pythons)}"' in (ROOT / ".ci" / "release").read_text()


def test_pythons_own_logging_is_found_from_the_checkout() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import logging; logging.getLogger(); print(logging.__file__)"],
        check=True,
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert Path(done.stdout.strip()).parent.name == "logging"
    assert ROOT not in Path(done.stdout.strip()).parents


PAGE = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8").partition("\n## Structure\n")[2]
ROWS = [re.findall(r"`([\w.]+)`", line.split("|")[1]) for line in PAGE.splitlines() if line.startswith("| `")]
LAYER = {room: len(ROWS) - i for i, row in enumerate(ROWS) for room in row}


@cache
def tree_of(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def modules() -> dict[str, Path]:
    """Return the files of the package by the names of their modules below `pushplan`."""
    folders = [ROOT / name for name in ("planners", "logging", "sim")]
    homes = [(ROOT / "pushplan", ROOT / "pushplan"), *((folder, ROOT) for folder in folders)]
    found = {}
    for folder, home in homes:
        for file in [*folder.rglob("*.py"), *folder.rglob("*.pyi")]:  # the core has stubs only
            name = ".".join(file.relative_to(home).with_suffix("").parts).removesuffix(".__init__")
            found[name] = file
    del found["__init__"]  # loads the public names on first use
    return found


def imported(tree: ast.AST, types: bool) -> Iterator[str]:
    """Return the names below `pushplan` that a module imports, also inside functions, and for types on request."""
    for node in ast.iter_child_nodes(tree):
        for_types = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        if isinstance(node, ast.expr) or (for_types and not types):
            continue
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pushplan."):
            yield from (f"{node.module}.{alias.name}".removeprefix("pushplan.") for alias in node.names)
        yield from imported(node, types)


def graph(types: bool = False) -> dict[str, set[str]]:
    files = modules()
    found = {}
    for module, file in files.items():
        names = set(imported(tree_of(file), types))
        targets = {name if name in files else name.rpartition(".")[0] for name in names}
        found[module] = targets & set(files) - {module}
    return found


WAY = re.findall(r"^\d+\. `([\w/.]+)`, `([\w.]+)`: ", PAGE, re.MULTILINE)


@pytest.mark.skipif(not (ROOT / "planners").is_dir(), reason="needs the sources, not a wheel")
def test_planning_calls_the_documented_functions_in_order(tmp_path: Path, capsys: Captured) -> None:
    files = modules()
    way = {files[module.removesuffix(".py").replace("/", ".")]: name for module, name in WAY}
    assert len(way) == len(WAY) <= 15
    met = dict[tuple[str, str], None]()

    def note(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_flags & CO_OPTIMIZED:  # not the body of a class
            met[code.co_filename, code.co_qualname.removesuffix(".__init__")] = None

    sys.setprofile(note)
    try:
        assert main(["plan", "two-crates", "--first", "-o", str(tmp_path / "run.mcap")]) == 0
    finally:
        sys.setprofile(None)
    assert "solved" in capsys.readouterr().out
    stops = [(Path(file).resolve(), name) for file, name in met]
    assert [stop for stop in stops if way.get(stop[0]) == stop[1]] == [*way.items()]
    for file in way:
        assert len(file.read_text(encoding="utf-8").splitlines()) <= 450
        functions = [node for node in ast.walk(tree_of(file)) if isinstance(node, ast.FunctionDef)]
        assert max((node.end_lineno or 0) - node.lineno + 1 for node in functions) <= 60, file


@pytest.mark.skipif(not (ROOT / "planners").is_dir(), reason="needs the sources, not a wheel")
def test_imports_point_downwards_and_form_no_circle() -> None:
    found = graph()
    rooms = sorted(LAYER, key=len, reverse=True)
    room = {module: next(room for room in rooms if f"{module}.".startswith(f"{room}.")) for module in found}
    assert set(room.values()) == set(LAYER)
    assert "planner" in found["run"]
    upwards = [
        (module, target)
        for module, targets in found.items()
        for target in targets
        if LAYER[room[target]] > LAYER[room[module]]
    ]
    assert upwards == []
    apart = {"planners": "sim", "sim": "planners"}
    assert [(m, t) for m, targets in found.items() for t in targets if apart.get(room[m]) == room[t]] == []
    tuple(TopologicalSorter(graph(types=True)).static_order())  # raises if modules import one another


LEFT_BEHIND = {
    r"bears|bearing on": "tolerates",
    r"errands?|legs|courses?": "task, transfer, measured push",
    r"way pushed|free words?": "pushed distance, collision-free steering path",
    r"several pushes|several objects": "multi-push plan, rearrangement", r"settled|wanted": "what it is",
    r"verdicts?|flaws?|troubles?|faults?|doubts?|judges?": "validator, validation result, error, warning, reason",
    r"findings?": "error", r"least possible": "optimality gap", r"auto in ecof": "planner auto, stable set ecof",
    r"kick(s|ed)?": "disturbance", r"worlds|misjudged": "Monte Carlo samples, model error",
    r"off its place|leans?": "pose error, load-distribution shift", r"soonest|anew": "fastest, recomputed",
    r"cut_off|plan_again": "incomplete, replan",
}  # fmt: skip
"""Replaced words (pattern) and their replacements."""
LEFT = re.compile(rf"(?<![\w/.`#-])({'|'.join(LEFT_BEHIND)})(?![\w/`.-]*\.(md|yaml|png))\b", re.IGNORECASE)
ALLOWED = (
    r"without (finding|a path)|from finding|root finding",
    r"`?findings`?\)|errors Finding|\.findings",  # of `ScenarioError`: a fixed public name
)


def words_left(text: str) -> list[str]:
    """Return the replaced words in a text, each with its surroundings."""
    around = [text[max(0, m.start() - 40) : m.end() + 40].replace("\n", " ") for m in LEFT.finditer(text)]
    return [one for one in around if not any(re.search(word, one, re.IGNORECASE) for word in ALLOWED)]


def pages() -> Iterator[tuple[str, str]]:
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        yield page.name, page.read_text("utf-8")


def helps() -> Iterator[tuple[str, str]]:
    for words in ([], *([name] for name in COMMANDS | MORE)):
        yield " ".join(words), CliRunner().invoke(command_line, [*words, "--help"]).output


def messages() -> Iterator[tuple[str, str]]:
    """Yield the texts of the package with more than one word, without docstrings."""
    for folder in ("pushplan", "planners", "sim", "logging"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            if file.is_symlink() or any(part.is_symlink() for part in file.parents):
                continue
            nodes = list(ast.walk(tree_of(file)))
            bare = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
            for node in nodes:
                text = node.value if isinstance(node, ast.Constant) and id(node) not in bare else None
                if isinstance(text, str) and " " in text.strip():
                    yield f"{file.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}", text


@pytest.mark.parametrize("texts", [pages, helps, messages])
def test_replaced_words_do_not_appear(texts: Callable[[], Iterator[tuple[str, str]]]) -> None:
    assert [f"{place}: {words}" for place, text in texts() for words in words_left(text)] == []


def test_libraries_that_the_readme_names_work_on_the_default_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """OMPL's calls are counted in `test_ompl.py`; SciPy's fit belongs to `identify`."""
    counts: Counter[str] = Counter()

    def count(name: str, owner: Any, function: str) -> None:
        original = getattr(owner, function)

        def counted(*arguments: Any, **options: Any) -> Any:
            counts[name] += 1
            return original(*arguments, **options)

        monkeypatch.setattr(owner, function, counted)

    count("Ruckig", ruckig.Ruckig, "calculate")
    count("Shapely", shapely, "distance")
    count("MCAP", mcap.writer.Writer, "add_message")
    assert pushplan.run("two-crates", log=tmp_path / "run.mcap", seed=1, iterations=500, time_limit=600.0).plan.solved
    assert min(counts[name] for name in ("Ruckig", "Shapely", "MCAP")) > 10, counts


@pytest.mark.parametrize("library", ["OMPL", "Ruckig", "SciPy", "Shapely", "MCAP"])
def test_files_that_the_readme_names_import_their_library(library: str) -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    paragraph = text[text.index("**Who does what.**") :].partition("\n\n")[0]
    own = paragraph[paragraph.index(f"{library} ") :]
    path = re.search(r"\]\(([\w/]+\.py)\)", own)
    assert path is not None
    file = Path(pushplan.__file__).parent / path[1].removeprefix("pushplan/")
    assert re.search(rf"^\s*(import|from) {library.lower()}\b", file.read_text("utf-8"), re.MULTILINE)
