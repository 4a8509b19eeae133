"""The layout for viewers shows topics and fields that the log really has."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import SeekingReader
from pushplan.logging.old.layout import layout, write_layout
from pushplan.logging.old.messages.schemas import TOPICS
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.view.window import window

KEYS = Path(__file__).parent / "data" / "lichtblick-keys.json"


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
    paths = [
        line["value"].replace("[:]", "")
        for config in plots
        for line in config["paths"]
        if not line["value"].isdigit()
    ]
    paths += [config["xAxisPath"]["value"].replace("[:]", "") for config in plots if "xAxisPath" in config]
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
    assert camera["distance"] >= max(
        view.ymax - view.ymin, view.xmax - view.xmin
    )  # in a panel as wide as high
    assert camera["near"] < camera["distance"] < camera["far"]
    assert camera["targetOffset"][:2] == pytest.approx(
        [(view.xmin + view.xmax) / 2, (view.ymin + view.ymax) / 2]
    )
    assert view.xmin < -0.5
    assert view.ymax > 2.0


def keys_known(folder: str) -> dict[str, Any]:
    """Return what Lichtblick's source (`data/lichtblick-keys.json`) says of a part of its configuration."""
    found: dict[str, Any] = json.loads(KEYS.read_text())[folder]
    return found


def test_every_key_is_one_that_the_viewer_reads(found: dict[str, Any]) -> None:
    for name, config in found["configById"].items():
        panel = name.split("!")[0]
        assert set(config) - {"foxglovePanelTitle"} <= set(keys_known(panel)), name
        assert config["lichtblickPanelTitle"] == config["foxglovePanelTitle"]
        for line in config.get("paths", []):
            assert set(line) <= set(keys_known("PlotPath"))
        if panel == "Plot":
            assert config["xAxisVal"] in keys_known("PlotXAxisVal")
            assert config["legendDisplay"] in keys_known("PlotLegendDisplay")
    scene = found["configById"]["3D!pushplan"]
    assert set(scene["cameraState"]) == set(keys_known("CameraState"))
    assert set(scene["scene"]) <= set(keys_known("scene"))
    assert set(scene["scene"]["transforms"]) <= set(keys_known("transforms"))
    assert all(set(topic) <= set(keys_known("topic")) for topic in scene["topics"].values())


def test_nothing_hides_the_scene(found: dict[str, Any]) -> None:
    scene = found["configById"]["3D!pushplan"]
    assert (
        scene["scene"]["transforms"]["lineWidth"] == 0
    )  # else a line runs from the world's origin to the pusher
    assert scene["transforms"] == {"frame:world": {"visible": False}}
    for name, config in found["configById"].items():
        if name.startswith("Plot"):
            assert (config["legendDisplay"], config["showPlotValuesInLegend"]) == ("left", False)


def test_the_costs_are_plotted_out_of_one_message(found: dict[str, Any]) -> None:
    plot = found["configById"]["Plot!pushplanprogress"]
    assert (
        plot["xAxisVal"] == "currentCustom"
    )  # Lichtblick cannot pair x and y of several messages on one topic
    assert plot["xAxisPath"]["value"] == "/planner/costs.iterations[:]"
    assert [line["value"] for line in plot["paths"]] == ["/planner/costs.cost[:]"]


def test_a_log_carries_its_layout(found: dict[str, Any], whole_log: bytes, tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(whole_log)
    with (tmp_path / "run.mcap").open("rb") as stream:
        attached = {one.name: one.data for one in SeekingReader(stream).iter_attachments()}
    assert json.loads(attached["layout.json"]) == found


def test_an_unsolved_run_shows_how_far_it_came(case: Any) -> None:
    unsolved = case.unsolved()
    made = layout(unsolved.scenario, unsolved.plan)["configById"]
    assert set(made) == {"3D!pushplan", "RosOut!pushplan"}
    assert made["RosOut!pushplan"]["lichtblickPanelTitle"] == "Why there is no plan"
    assert made["3D!pushplan"]["topics"]["/plan/tree"] == {"visible": True}
    assert made["3D!pushplan"]["topics"]["/plan/nearest"] == {"visible": True}
    assert made["3D!pushplan"]["lichtblickPanelTitle"] == "two-crates: no plan"


def test_an_unsolved_run_has_a_layout_too(case: Any, tmp_path: Path) -> None:
    unsolved = case.unsolved()
    assert panels(layout(unsolved.scenario, unsolved.plan)["layout"])
