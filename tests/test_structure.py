"""The house: imports point downwards as docs/contributing.md draws them, and no modules form a circle."""

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8").partition("\n## Structure\n")[2]
ROWS = [re.findall(r"`(\w+)`", line.split("|")[1]) for line in PAGE.splitlines() if line.startswith("| `")]
LAYER = {room: len(ROWS) - i for i, row in enumerate(ROWS) for room in row}


def modules() -> dict[str, Path]:
    """Files of the package by the names of their modules below `pushplan`."""
    folders = [ROOT / name for name in ("planners", "logging", "sim")]
    homes = [(ROOT / "pushplan", ROOT / "pushplan"), *((folder, ROOT) for folder in folders)]
    found = {}
    for folder, home in homes:
        for file in [*folder.rglob("*.py"), *folder.rglob("*.pyi")]:  # the core has stubs only
            name = ".".join(file.relative_to(home).with_suffix("").parts).removesuffix(".__init__")
            found[name] = file
    del found["__init__"]  # loads the public names when they are first used
    return found


def imported(tree: ast.AST) -> Iterator[str]:
    """Names below `pushplan` that a module imports, also inside functions, but not for types only."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pushplan."):
            yield from (f"{node.module}.{alias.name}".removeprefix("pushplan.") for alias in node.names)
        yield from imported(node)


def graph() -> dict[str, set[str]]:
    files = modules()
    found = {}
    for module, file in files.items():
        names = set(imported(ast.parse(file.read_text(encoding="utf-8"))))
        targets = {name if name in files else name.rpartition(".")[0] for name in names}
        found[module] = targets & set(files) - {module}
    return found


def test_imports_point_downwards_and_form_no_circle() -> None:
    found = graph()
    room = {module: module.partition(".")[0] for module in found}
    assert set(room.values()) == set(LAYER)
    assert "planners.planner" in found["run"]
    upwards = [
        (module, target)
        for module, targets in found.items()
        for target in targets
        if LAYER[room[target]] > LAYER[room[module]]
    ]
    assert upwards == []
    tuple(TopologicalSorter(found).static_order())  # raises where modules import one another
