"""What the page about run logs says is so."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from pushplan.logging.old.messages import blocks
from pushplan.logging.old.messages.schemas import TOPICS

PAGE = Path(__file__).parents[2] / "docs" / "run-log.md"


def test_every_topic_is_described_with_its_message() -> None:
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| `/")]
    told: dict[str, str] = {}
    for row in rows:
        topics, messages = (cell.strip() for cell in row.split("|")[1:3])
        names, kinds = re.findall(r"`([^`]+)`", topics), messages.split(", ")
        told |= dict(zip(names, kinds * len(names) if len(kinds) == 1 else kinds, strict=False))
    assert told == {topic.name: topic.message.DESCRIPTOR.full_name for topic in TOPICS}


def test_the_line_that_reads_byte_planes_reads_them() -> None:
    found = re.search(r"`(np\.frombuffer\(.*)`", PAGE.read_text())
    assert found is not None
    values = np.random.default_rng(1).normal(size=(7, 3, 2))
    read: Any = eval(found[1], {"np": np, "array": blocks.encode("a", values)})
    assert read.tobytes() == values.tobytes()
