"""The layout for viewers shows topics and fields that the log really has."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from pushplan.logging.messages.schemas import TOPICS
from pushplan.logging.reader import read_run
from pushplan.logging.view.layout import layout, write_layout
from pushplan.logging.view.window import window


@pytest.fixture(scope="module")
def found(case: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the layout of a run, as a viewer would read it."""
    folder = tmp_path_factory.mktemp("layout")
    write_layout(read_run(case.write(folder / "run.mcap")), folder / "layout.json")
    read: dict[str, Any] = json.loads((folder / "layout.json").read_text())
    return read


def panels(node: Any) -> set[str]:
    """Return the panels that a node of the layout's tree holds."""
    return {node} if isinstance(node, str) else panels(node["first"]) | panels(node["second"])


def test_every_panel_is_placed_once_and_configured(found: dict[str, Any]) -> None:
    assert panels(found["layout"]) == set(found["configById"])
    assert {name.split("!")[0] for name in found["configById"]} == {"3D", "Plot", "RosOut"}


def test_every_topic_and_field_exists(found: dict[str, Any]) -> None:
    topics = {topic.name: topic.message.DESCRIPTOR for topic in TOPICS}
    plots = [config for name, config in found["configById"].items() if name.startswith("Plot")]
    paths = [line["value"] for config in plots for line in config["paths"] if not line["value"].isdigit()]
    paths += [config["xAxisPath"]["value"] for config in plots if "xAxisPath" in config]
    assert "/margins.contacts[1].margin" in paths
    for path in paths:
        topic, *fields = re.sub(r"\[\d+\]", "", path).split(".")
        descriptor = topics[topic]
        for field in fields:
            descriptor = descriptor.fields_by_name[field].message_type
    assert set(found["configById"]["3D!pushplan"]["topics"]) <= set(topics)
    assert found["configById"]["RosOut!pushplan"]["topicToRender"] in topics


def test_the_camera_looks_down_on_everything(found: dict[str, Any], case: Any) -> None:
    camera = found["configById"]["3D!pushplan"]["cameraState"]
    view = window(case.scenario, case.plan)
    assert camera["perspective"] is False
    assert camera["distance"] == pytest.approx(view.ymax - view.ymin)
    assert camera["targetOffset"][:2] == pytest.approx(
        [(view.xmin + view.xmax) / 2, (view.ymin + view.ymax) / 2]
    )
    assert view.xmin < -0.5
    assert view.ymax > 2.0


def test_an_unsolved_run_has_a_layout_too(case: Any, tmp_path: Path) -> None:
    unsolved = case.unsolved()
    assert panels(layout(read_run(unsolved.write(tmp_path / "run.mcap")))["layout"])
