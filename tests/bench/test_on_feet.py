"""Scenarios on four feet: the same problem, on supports that a physics engine knows exactly."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import yaml

from pushplan.bench.on_feet import on_feet
from pushplan.bench.random_problems.generator import generate
from pushplan.bench.random_problems.parameters import ProblemParameters
from pushplan.mechanics.support import FeetSupport
from pushplan.scenario.file import example_names, example_text, scenario_from_document

TEXTS = {
    **{name: example_text(name) for name in example_names()},
    **{f"random {seed}": generate(ProblemParameters(), seed) for seed in range(3)},
}


@pytest.mark.parametrize("name", TEXTS)
def test_every_object_stands_on_four_feet_under_it_with_its_centre_of_mass(name: str) -> None:
    document = yaml.safe_load(TEXTS[name])
    before, after = scenario_from_document(document), scenario_from_document(on_feet(document))
    for old, new in zip(before.chain.objects, after.chain.objects, strict=True):
        assert isinstance(new.support, FeetSupport)
        assert new.support.positions.shape == (4, 2)
        assert shapely.Polygon(new.outline).covers(shapely.MultiPoint(new.support.positions))
        np.testing.assert_allclose(new.support.center, old.support.center, atol=1e-7)
        np.testing.assert_array_equal(new.pose_chain, old.pose_chain)


def test_four_feet_with_known_loads_stay() -> None:
    document = yaml.safe_load(TEXTS["feet"])
    assert on_feet(document) == document
