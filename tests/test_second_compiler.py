"""The second compiler starts with the first function compiled, is waited for, and never outlives the first one."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numba
import pytest

from pushplan.compiled import second_compiler as module
from pushplan.compiled.second_compiler import second_compiler
from pushplan.kernels import compile_search


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let the process write a file after a fifth of a second instead."""
    file = tmp_path / "done"
    work = f"import time; time.sleep(0.2); open({str(file)!r}, 'a').write({{!r}})"
    monkeypatch.setattr(module, "WORK", work)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    return file


def compile_something() -> None:
    numba.njit(lambda x: x + 1)(1)


def test_it_is_started_once_and_waited_for(mark: Path) -> None:
    with second_compiler("sst"):
        compile_something()
        compile_something()
    assert mark.read_text() == "sst"


def test_it_does_not_start_when_nothing_is_compiled(mark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("subprocess.Popen", _must_not_start)
    with second_compiler("sst"):
        pass
    compile_something()
    assert not mark.exists()


def _must_not_start(*_: object, **__: object) -> None:
    raise AssertionError("a process was started")


def _interrupted(mark: Path) -> None:
    with second_compiler("sst"):
        compile_something()
        while not (mark.exists() and mark.read_text()):
            time.sleep(0.01)
        raise KeyboardInterrupt


def test_it_ends_with_the_first_one(mark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    work = f"import os, time; open({str(mark)!r}, 'w').write(str(os.getpid())); time.sleep(60) # {{!r}}"
    monkeypatch.setattr(module, "WORK", work)
    with pytest.raises(KeyboardInterrupt):
        _interrupted(mark)
    with pytest.raises(ProcessLookupError):
        os.kill(int(mark.read_text()), 0)


def test_a_single_processor_compiles_alone(mark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    monkeypatch.setattr("subprocess.Popen", _must_not_start)
    with second_compiler("sst"):
        compile_something()
    assert not mark.exists()


def test_what_it_runs_exists() -> None:
    assert module.WORK.format("auto").startswith("from pushplan.kernels import compile_search;")
    compile_search("auto")
