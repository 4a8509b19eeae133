"""Identification that is over soon: a rough answer is one, too."""

import pytest

from pushplan.sim.identify import posterior


def rough_identification(patch: pytest.MonkeyPatch) -> None:
    """Let few members of the ensemble, and few starts, do."""
    for name, value in {"MEMBERS": 8, "ROUNDS": 4, "PASSES": 1, "_BATCH": 20}.items():
        patch.setattr(posterior, name, value)
    patch.setattr("pushplan.sim.identify.identify.LOOKED_AT", 16)
    patch.setattr("pushplan.sim.identify.identify.STARTS", 1)
