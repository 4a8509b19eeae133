"""Chains as the core holds them: what does not fit is refused, arrays are read-only, pickles are the same chain."""

import pickle
from typing import Any

import numpy as np
import pytest
from conftest import ChainMaker

import pushplan.core.contacts as contacts
import pushplan.core.uncertain as uncertain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.packed import pack_chain
from pushplan.mechanics.uncertain import pack_centred, pack_intervals

TWISTS = np.array([[1.0, 0.0, 0.0], [1.0, 0.2, 3.0], [0.1, -0.2, -20.0]])
FIELDS = ("objects", "parts", "series", "links", "rows", "length")


def fields_of(packed: contacts.PackedChain) -> dict[str, Any]:
    return {name: getattr(packed, name) for name in FIELDS}


def test_a_pickled_chain_gives_the_same_margins(make_chain: ChainMaker) -> None:
    chain = make_chain.random(3, 4, tree=True)
    packed = pack_chain(chain)
    again = pickle.loads(pickle.dumps(packed))
    for name, value in fields_of(packed).items():
        np.testing.assert_array_equal(getattr(again, name), value)
    np.testing.assert_array_equal(
        contacts.margins_of(again, TWISTS), contacts.margins_of(packed, TWISTS), strict=True
    )
    interval = IntervalChain.from_ranges(chain, pressures={"object0": 0.1})
    for loads in (pack_centred(chain), pack_intervals(interval)):
        found = uncertain.rows_of(pickle.loads(pickle.dumps(loads)), TWISTS)
        for one, other in zip(found, uncertain.rows_of(loads, TWISTS), strict=True):
            np.testing.assert_array_equal(one, other, strict=True)


def wrong_links(links: np.ndarray[Any, Any], column: int, value: int) -> np.ndarray[Any, Any]:
    changed = links.copy()
    changed[0, column] = value
    return changed


def test_arrays_that_do_not_fit_together_are_refused(make_chain: ChainMaker) -> None:
    fields = fields_of(pack_chain(make_chain.boxes(2)))
    objects, links, rows = fields["objects"], fields["links"], fields["rows"]
    wrong = [
        ({"objects": objects[:, :-1]}, r"objects has shape \(2, 10\); it must be \(any, 11\)"),
        ({"objects": objects[:1]}, "series has shape"),
        ({"parts": fields["parts"][:, :4]}, "parts has shape"),
        ({"links": wrong_links(links, 2, 99)}, "parts of object 0"),
        ({"links": wrong_links(links, 1, -1)}, "parts of object 0"),
        ({"links": wrong_links(links, 3, 1)}, "object 0 is pushed by a later one"),
        ({"rows": rows[:1]}, "rows for every contact"),
    ]
    for changed, message in wrong:
        with pytest.raises(ValueError, match=message):
            contacts.PackedChain(**{**fields, **changed})
    with pytest.raises(ValueError, match="packed without contacts"):
        contacts.margins_of(contacts.PackedChain(**{**fields, "rows": rows[:0]}), TWISTS)
    with pytest.raises(ValueError, match="twists"):
        contacts.margins_of(contacts.PackedChain(**fields), TWISTS[:, :2])
