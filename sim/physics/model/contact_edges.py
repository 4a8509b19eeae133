"""The straight edges that meet in a contact: the segment between two bodies is where two such edges overlap."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.chain import Contact
from pushplan.util.arrays import FloatArray

_ON_LINE = 1e-6
"""Distance from the contact's line within which a corner belongs to it, m."""


def edge_extent(contact: Contact, outline: FloatArray) -> tuple[float, float]:
    """Return how far a body's edge reaches along the contact: (right, left) end as coordinates of its tangent, m.

    The coordinate is 0 at the right end of the segment and its length at the left end. Where the body has no
    edge under the whole segment, the segment itself is the edge.

    Args:
        contact: In the same frame as the outline.
        outline: (v, 2) corners of the body, m.
    """
    offsets = outline - contact.right
    along, across = offsets @ contact.tangent, offsets @ contact.normal
    on_line = np.abs(across) < _ON_LINE
    edges = on_line & np.roll(on_line, -1)
    spans = np.sort(np.stack([along, np.roll(along, -1)], axis=1)[edges], axis=1)
    low, high = 0.0, contact.length
    for begin, end in np.tile(spans, (len(spans), 1)):  # again and again: an edge may be cut into many
        if begin <= high + _ON_LINE and end >= low - _ON_LINE:
            low, high = min(low, float(begin)), max(high, float(end))
    return low, high
