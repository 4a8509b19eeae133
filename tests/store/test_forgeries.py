"""Forged logs are not verified. These tests use every fourth forgery; `benchmarks/attacks.py` uses all."""

from pathlib import Path

import pytest
from store.forgeries import FORGERIES, Forgery

from pushplan.verification import verify_log


@pytest.mark.parametrize("forgery", FORGERIES[::4], ids=lambda one: f"{one.kind}: {one.name}")
def test_a_forged_log_is_not_verified(forgery: Forgery, tmp_path: Path) -> None:
    forgery.write(tmp_path / "run.mcap")
    assert not verify_log(tmp_path / "run.mcap").matches
