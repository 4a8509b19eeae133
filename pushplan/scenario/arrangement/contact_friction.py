"""Which coefficient of friction holds at which contact of a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pushplan.mechanics.chain import PLATE
from pushplan.scenario.schema.findings import nearest
from pushplan.scenario.schema.scenario import StatedRoom
from pushplan.scenario.values.interval import Span
from pushplan.scenario.yaml.node import shorten
from pushplan.scenario.yaml.report import Report

PUSHER = "pusher"
"""What `contacts.between` calls the plate."""

Pair = tuple[int, int]


def contact_frictions(file: StatedRoom, pairs: Iterable[Pair], report: Report) -> dict[Pair, float | Span]:
    """Return the friction of each pair (pushing, pushed) of bodies that touch; what is missing is reported."""
    names = [obj.name for obj in file.objects]
    stated = _stated(file, names, report)
    frictions: dict[Pair, float | Span] = {}
    touching = set()
    for pair in pairs:
        key = frozenset(PUSHER if i == PLATE else names[i] for i in pair)
        touching.add(key)
        value = stated.get(key, file.pusher.friction if PLATE in pair else file.contacts.friction)
        if value is None:
            first, second = (names[i] for i in pair)
            what = f"is missing, and '{first}' and '{second}' touch; needed: a friction coefficient"
            report.add(("contacts", "friction"), what)
        else:
            frictions[pair] = value
    complete = len(frictions) == len(names)
    for i, entry in enumerate(file.contacts.between):
        if complete and frozenset(entry.objects) in set(stated) - touching:
            first, second = entry.objects
            report.add(
                ("contacts", "between", i, "objects"), f"'{first}' and '{second}' do not touch; leave it out"
            )
    return frictions


def _stated(file: StatedRoom, names: Sequence[str], report: Report) -> dict[frozenset[str], float | Span]:
    """Return the frictions that `contacts.between` states, and report entries that name no pair."""
    stated: dict[frozenset[str], float | Span] = {}
    known = [*names, PUSHER]
    for i, entry in enumerate(file.contacts.between):
        place = ("contacts", "between", i, "objects")
        unknown = [(k, name) for k, name in enumerate(entry.objects) if name not in known]
        for k, name in unknown:
            what = f"no object is called '{shorten(name)}'{nearest(name, known)} allowed: {', '.join(known)}"
            report.add((*place, k), what)
        pair = frozenset(entry.objects)
        if len(pair) == 1 and not unknown:
            report.add(place, "names one object twice; allowed: two objects that touch")
        elif pair in stated:
            report.add(place, "this pair stands further up already; keep one entry")
        elif not unknown:
            stated[pair] = entry.friction
    return stated
