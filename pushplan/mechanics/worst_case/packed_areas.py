"""A chain as the arrays that compiled code asks for its worst pressures."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts.carried import carried_objects
from pushplan.mechanics.friction.packed import contact_rows
from pushplan.mechanics.worst_case.area_table import pack_area, table_rows
from pushplan.mechanics.worst_case.load_area import load_areas
from pushplan.mechanics.worst_case.robust_kernel import PackedAreas
from pushplan.util.arrays import FloatArray


def pack_areas(chain: Chain, loads: FloatArray | None = None) -> PackedAreas:
    """Return the arrays of `chain`.

    Args:
        chain: Objects and contacts.
        loads: (n, 2) least and largest friction load of every object, N; without it, what the objects say.

    Raises:
        SupportError: When a push at the contact height could tip an object.
    """
    length, areas = chain.characteristic_length, load_areas(chain)
    if loads is None:
        loads = np.array([[obj.friction_load, obj.friction_load] for obj in chain.objects])
    rows = max(table_rows(area) for area in areas)
    facets = np.array([contact_rows(contact, length) for contact in chain.contacts])
    return PackedAreas(
        tables=np.array([pack_area(area, rows) for area in areas]),
        loads=loads,
        carried=carried_objects(chain),
        facets=facets / [1.0, 1.0, length],
        length=length,
    )
