"""The house: folders in layers, imports only downwards, and the page that says so."""

from __future__ import annotations

import importlib.util
from graphlib import CycleError
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def structure() -> ModuleType:
    spec = importlib.util.spec_from_file_location("structure", ROOT / "docs" / "structure.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_two_places_import_one_another(structure: ModuleType) -> None:
    graph = structure.imports()
    layer = structure.layers(graph)
    assert all(layer[target] < layer[name] for name, targets in graph.items() for target in targets)
    graph["pushplan.geometry"] = {"pushplan.planners"}
    with pytest.raises(CycleError, match=r"pushplan\.geometry"):
        structure.layers(graph)


def test_what_is_left_out_is_reached_through_others(structure: ModuleType) -> None:
    graph = {"a": {"b", "c"}, "b": {"c"}, "c": set()}
    assert structure.direct(graph) == {"a": {"b"}, "b": {"c"}, "c": set()}


def test_the_page_is_what_the_imports_give(structure: ModuleType) -> None:
    assert structure.PAGE.read_text(encoding="utf-8") == structure.page(), "run `python docs/structure.py`"


def test_every_place_says_what_it_holds(structure: ModuleType) -> None:
    for name in structure.imports():
        assert structure.sentence(name).endswith("."), name
