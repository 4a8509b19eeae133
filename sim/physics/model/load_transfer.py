"""Pushes above the floor: contact forces at a height shift the load of an object from foot to foot.

Friction F on an object asks the floor for the moment -h F when the contact forces that overcome it act at height h:
the loads on the feet change by -k_i x_i . S^-1 h F, with their stiffnesses k_i and S = sum_i k_i x_i x_i^T about the
centre of these, as under a stiff object on springs. Inertial forces are taken to act at that height as well.
"""

from __future__ import annotations

import numpy as np

from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.friction.packed import pack_chain
from pushplan.sim.physics.model.bodies import Standing
from pushplan.sim.physics.model.chain_model import PhysicsModel
from pushplan.util.arrays import FloatArray

_FOLLOWING = 0.3
"""Share of a change of force that the loads follow within one time step."""


class LoadTransfer:
    """Keeps the loads on the feet of all objects in balance with the friction that the engine finds under them.

    Raises:
        SupportError: When the push at the contact height could lift a part of an object.
    """

    def __init__(self, chain: Chain) -> None:
        pack_chain(chain)  # refuses what would tip
        self._height = chain.pusher.contact_height
        self._friction = np.zeros((len(chain.objects), 2))

    def follow(self, model: PhysicsModel) -> None:
        """Shift the loads to where the friction of the last time steps wants them."""
        if self._height == 0.0:
            return
        self._friction += _FOLLOWING * (model.floor_forces() - self._friction)
        turned = model.motions()[:, 2]
        for i, standing in enumerate(model.standing):
            if standing is not None:
                shift = self._shift(standing, float(turned[i]), -self._height * self._friction[i])
                standing.load(model.model, model.data, standing.loads + shift)

    def _shift(self, standing: Standing, turned: float, moment: FloatArray) -> FloatArray:
        positions, stiffness = standing.feet.positions, standing.feet.stiffness
        offsets = rotate(standing.heading + turned, positions - stiffness @ positions)
        second = (offsets * stiffness[:, None]).T @ offsets
        return np.asarray(stiffness * (offsets @ np.linalg.solve(second, moment)))
