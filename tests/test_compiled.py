"""The cache of compiled code is of the sources that it was made from."""

from __future__ import annotations

from pathlib import Path

import pytest

from pushplan.compiled import _digest

SOURCE = "from pushplan.compiled import {0}\n\n\n@{0}\ndef twice(x):\n    return {1} * x\n"


@pytest.mark.parametrize("decorator", ["compiled", "lean", "woven", "intrinsic", "overload"])
def test_another_source_of_compiled_code_gives_another_digest(decorator: str, tmp_path: Path) -> None:
    source = tmp_path / "kernel.py"
    source.write_text(SOURCE.format(decorator, 2))
    before = _digest([tmp_path])
    assert _digest([tmp_path]) == before
    source.write_text(SOURCE.format(decorator, 3))
    assert _digest([tmp_path]) != before


def test_sources_without_compiled_code_do_not_count(tmp_path: Path) -> None:
    before = _digest([tmp_path])
    (tmp_path / "plain.py").write_text("def twice(x):\n    return 2 * x\n")
    assert _digest([tmp_path]) == before
