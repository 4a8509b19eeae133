"""Draws which folder imports which, as docs/structure.md: run `python docs/structure.py` after a change of imports.

Nodes are the folders, and the modules of `pushplan/` itself. They stand in layers: each imports only what stands
below it. tests/test_structure.py holds the page against the code.
"""

from __future__ import annotations

import ast
import sys
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "structure.md"
LINKED = ("planners", "sim", "logging")
"""Folders of the checkout that the package has as links; they have no `__init__.py`."""
SENTENCES = {
    "planners": "From searches with one margin after the other to a timed trajectory, or why there is none.",
    "sim": "Execution of a trajectory, and who judges it.",
    "logging": "Run logs: write, read, recover, verify.",
}
HEAD = """\
# Structure

Where a given change goes is told in [contributing](contributing.md). This is what there is: folders, and the modules
of `pushplan/` itself, in layers. Each imports only from layers below its own; what it reaches through others is left
out of the last column. Made by `docs/structure.py` from the imports, held by `tests/test_structure.py`.

| layer | place | what it holds | rests on |
|---:|---|---|---|
"""


def modules() -> dict[str, Path]:
    """Return the files of the package by the full names of their modules."""
    found = {}
    for folder in ("pushplan", *LINKED):
        prefix = () if folder == "pushplan" else ("pushplan",)
        for file in sorted((ROOT / folder).rglob("*.py")):
            parts = file.relative_to(ROOT).with_suffix("").parts
            if folder != "pushplan" or parts[1] not in LINKED:
                found[".".join((*prefix, *parts)).removesuffix(".__init__")] = file
    return found


def place(module: str, file: Path) -> str:
    """Return the folder of a module; a module of `pushplan/` itself is a place of its own."""
    if file.name == "__init__.py" or module.count(".") == 1:
        return module
    return module.rpartition(".")[0]


def imports() -> dict[str, set[str]]:
    """Return the places that each place imports from, also inside functions; `pushplan/__init__.py` is left out."""
    files = modules()
    found: dict[str, set[str]] = {place(*item): set() for item in files.items()}
    for module, file in files.items():
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            for name in _names(node):
                known = name if name in files else name.rpartition(".")[0]
                if known in files and known != "pushplan":
                    found[place(module, file)].add(place(known, files[known]))
    del found["pushplan"]
    return {name: targets - {name} for name, targets in found.items()}


def _names(node: ast.AST) -> list[str]:
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return [f"{node.module}.{alias.name}" for alias in node.names]
    return [alias.name for alias in node.names] if isinstance(node, ast.Import) else []


def layers(graph: dict[str, set[str]]) -> dict[str, int]:
    """Return the layer of each place, 0 for what imports nothing.

    Raises:
        graphlib.CycleError: When places import one another.
    """
    found: dict[str, int] = {}
    for name in TopologicalSorter(graph).static_order():
        found[name] = 1 + max((found[target] for target in graph[name]), default=-1)
    return found


def direct(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """Return the imports without those that lead through another one as well."""
    beyond: dict[str, set[str]] = {}
    for name in TopologicalSorter(graph).static_order():
        beyond[name] = set().union(*(beyond[target] | {target} for target in graph[name]))
    return {name: targets - set().union(*(beyond[x] for x in targets)) for name, targets in graph.items()}


def sentence(name: str) -> str:
    """Return what a place says that it holds."""
    short = name.removeprefix("pushplan.")
    if short in SENTENCES:
        return SENTENCES[short]
    told = ast.get_docstring(ast.parse(modules()[name].read_text(encoding="utf-8"))) or ""
    return told.partition("\n")[0]


def page() -> str:
    """Return the page."""
    graph = imports()
    layer, rests = layers(graph), direct(graph)
    short = {name: name.removeprefix("pushplan.") for name in graph}
    lines = [
        f"| {layer[name]} | `{short[name]}` | {sentence(name)} | {', '.join(sorted(short[x] for x in rests[name]))} |"
        for name in sorted(graph, key=lambda name: (-layer[name], name))
    ]
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    sys.stdout.write(f"{PAGE.relative_to(ROOT)} written\n")
