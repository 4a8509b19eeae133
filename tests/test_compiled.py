"""The cache is of the sources that it was made from; untried versions of numba give the same results plainly."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numba
import pytest

from pushplan.compiled import compiled, inner, private
from pushplan.compiled.cache import digest_of

SOURCE = "from pushplan.compiled import {0}\n\n\n@{0}\ndef twice(x):\n    return {1} * x\n"


@pytest.mark.parametrize(
    "decorator", ["compiled", "no_refcount", "inlined", "inner", "intrinsic", "overload"]
)
def test_another_source_of_compiled_code_gives_another_digest(decorator: str, tmp_path: Path) -> None:
    source = tmp_path / "kernel.py"
    source.write_text(SOURCE.format(decorator, 2))
    before = digest_of([tmp_path])
    assert digest_of([tmp_path]) == before
    source.write_text(SOURCE.format(decorator, 3))
    assert digest_of([tmp_path]) != before


def test_sources_without_compiled_code_do_not_count(tmp_path: Path) -> None:
    before = digest_of([tmp_path])
    (tmp_path / "plain.py").write_text("def twice(x):\n    return 2 * x\n")
    assert digest_of([tmp_path]) == before


@inner
def _half(x: float) -> float:
    return x / 2.0


@compiled
def _quarter(x: float) -> float:
    return _half(_half(x))


def test_inner_functions_are_called_by_compiled_ones_and_refuse_calls_from_python() -> None:
    assert _quarter(2.0) == 0.5
    if private.USED:
        with pytest.raises(TypeError, match="_half has no wrapper for calls from Python"):
            _half(2.0)


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return `private` as it is with a version of numba that nobody has tried."""
    monkeypatch.setattr(numba, "__version__", "99.1.0")
    spec = importlib.util.spec_from_file_location("plain_private", private.__file__)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_private_parts_are_used_with_this_version() -> None:
    assert private.USED == private.COMPILES


def test_an_untried_version_gets_the_plain_way(plain: ModuleType) -> None:
    assert not plain.USED
    assert plain.NO_REFCOUNT == plain.NO_WRAPPER == {}
    assert plain.inner_of(numba.njit(lambda x: x + 1))(1) == 2
    scratch, integers = plain.scratch, plain.scratch_integers

    def total(size: float) -> float:
        table, order = scratch(3, 2), integers(3)
        for i in range(3):
            order[i] = 2 - i
            table[i, 0], table[i, 1] = size * i, size
        return float(table[order[0], 0] + table[1, 1])

    assert plain.entry_point(numba.njit(total, **plain.NO_REFCOUNT), (numba.float64,))(2.0) == 6.0
    told: list[str] = []
    with plain.on_compiling(lambda: told.append("compiled")):
        assert numba.njit(lambda x: x + 1)(1) == 2
    assert not told
