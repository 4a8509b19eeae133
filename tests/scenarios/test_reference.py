"""The reference page of the scenario file agrees with what the loader takes."""

import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from pushplan.scenario import schema

PAGE = Path(__file__).parents[2] / "docs" / "scenario-file.md"
SECTIONS: dict[str, type[BaseModel]] = {
    "Top level": schema.ScenarioFile,
    "`objects`": schema.Object,
    "`contacts`": schema.Contacts,
    "`pusher`": schema.Plate,
    "`robot`": schema.Robot,
    "`goal`": schema.GoalPose,
    "`stability`": schema.StabilityChoice,
    "`planner`": schema.PlannerChoice,
}


def rows(section: str) -> dict[str, str]:
    """Return the rows of a section's tables by key."""
    text = PAGE.read_text(encoding="utf-8").split(f"## {section}\n")[1].split("\n## ")[0]
    found = re.findall(r"^\| `(\w+)` \|(.*)\|$", text, flags=re.MULTILINE)
    return dict(found)


@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_is_described_with_its_default(section: str) -> None:
    described = rows(section)
    fields = dict(SECTIONS[section].model_fields)
    if section == "`pusher`":
        fields |= schema.MotionLimits.model_fields
    elsewhere = {
        "limits",
        "goals",
        "gather",
    }  # files with `goals` state several problems, and are read by themselves
    assert set(described) - elsewhere == set(fields) - elsewhere
    for key, field in fields.items():
        last = described.get(key, "").rsplit("|", 1)[-1]
        assert ("required" in last) == field.is_required(), key
        if isinstance(field.default, str | float | int):
            assert re.search(rf"(^|[\s`]){re.escape(str(field.default))}($|[\s`])", last), key
