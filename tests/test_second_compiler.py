"""The second compiler starts when compiling takes long, is waited for, and never outlives the first one."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from pushplan import second_compiler
from pushplan.kernels import compile_search
from pushplan.second_compiler import SecondCompiler


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let the process write a file after a fifth of a second instead."""
    file = tmp_path / "done"
    work = f"import time; time.sleep(0.2); open({str(file)!r}, 'w').write({{!r}})"
    monkeypatch.setattr(second_compiler, "WORK", work)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    return file


def test_it_is_waited_for(mark: Path) -> None:
    with SecondCompiler("sst", 0.0) as second:
        time.sleep(0.1)
        second.wait()
    assert mark.read_text() == "sst"


def test_it_does_not_start_when_nothing_takes_long(mark: Path) -> None:
    with SecondCompiler("sst", 0.05) as second:
        second.wait()
    time.sleep(0.5)
    assert not mark.exists()


def _interrupted() -> None:
    with SecondCompiler("sst", 0.0):
        time.sleep(0.1)
        raise KeyboardInterrupt


def test_it_ends_with_the_first_one(mark: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        _interrupted()
    time.sleep(0.5)
    assert not mark.exists()


def test_a_single_processor_compiles_alone(mark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    with SecondCompiler("sst", 0.0) as second:
        time.sleep(0.1)
        second.wait()
    time.sleep(0.4)
    assert not mark.exists()


def test_what_it_runs_exists() -> None:
    assert second_compiler.WORK.format("auto").startswith("from pushplan.kernels import compile_search;")
    compile_search("auto")
