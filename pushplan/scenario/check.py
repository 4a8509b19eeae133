"""What reading leaves out: whether the stable set is empty, and what plain numbers say but hardly mean."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pushplan.errors import Finding, PushplanError, TippingError
from pushplan.mechanics.chain import PLATE
from pushplan.scenario.model import Scenario
from pushplan.scenario.source import Place, Source
from pushplan.util.names import AUTO, KNOWN_LOAD_SETS, STABLE_SETS

LONGEST = 20.0
"""Side, or distance of an axle, up to which a plain number is taken for metres without a question, m."""

SPEEDS = 1e-3, 5.0
"""Least and largest speed that is taken without a question, m/s."""


def check_scenario(scenario: Scenario) -> tuple[Finding, ...]:
    """Return what `load_scenario` leaves out because it takes longer: whether the stable set is empty.

    The set is that of `scenario.stability`; one that needs loads which the scenario does not state is a finding too.
    Of several pushes, the contact that the file states is only one of those that may be chosen.
    """
    unknown = [obj.name for obj in scenario.chain.objects if not obj.support.known]
    if unknown and scenario.stability.set in KNOWN_LOAD_SETS:
        others = ", ".join(other for other in STABLE_SETS if other not in KNOWN_LOAD_SETS)
        what = f"'{scenario.stability.set}' needs to know how loads rest on the floor, which is not stated for "
        what += f"{', '.join(map(repr, unknown))}; allowed: {others}, or a support with known loads"
        return (_finding(scenario, ("stability", "set"), what),)
    if not scenario.task.held:
        return ()
    from pushplan.sets.known_load_sets import emptiness

    margin = scenario.stability.margin
    try:
        stable = scenario.stable_set()
        what, contact = emptiness(stable, 0.0 if margin == AUTO else margin)
    except PushplanError as error:
        at: Place = ("pusher",) if isinstance(error, TippingError) else ("stability", "set")
        return (_finding(scenario, at, str(error)),)
    place: Place = ("stability", "margin")
    if contact is not None:
        on_plate = stable.chain.contacts[contact].pusher == PLATE
        place = ("pusher", "friction") if on_plate else ("contacts",)
    return (_finding(scenario, place, what),) if what else ()


def _finding(scenario: Scenario, place: Place, what: str) -> Finding:
    """Return a finding about a place of the file, or without a line where there is no file."""
    return (
        Finding(".".join(map(str, place)), what) if scenario.origin is None else scenario.origin.finding(place, what)
    )


def length_question(source: Source) -> Finding | None:
    """Return the question whether a length that is a plain number is in mm; one with a unit is never asked about."""
    stated = source.root.plain()
    known = [key for key in ("objects", "robot", "pusher") if isinstance(stated, Mapping) and key in stated]
    for place, found in _nodes({key: stated[key] for key in known}):
        kind, length, what = place[-1] if place else "", 0.0, "long"
        if kind in ("box", "polygon"):
            numbers = _numbers(found)
            length = max(numbers, default=0.0) - (min(numbers, default=0.0) if kind == "polygon" else 0.0)
        elif kind == "axle" and isinstance(found, list) and found:
            place, length, what = (*place, 0), next(iter(_numbers(found[0])), 0.0), "from the plate"
        if abs(length) > LONGEST:
            question = f'is {length:g} m {what}: mm? plain numbers are m; write "{length:g} mm" if so, everywhere'
            return source.finding(place, question)
    return None


def questions(source: Source) -> tuple[Finding, ...]:
    """Return what is to be asked about numbers that a file states but hardly means."""
    length = length_question(source)
    found = [] if length is None else [length]
    for place, speed in _nodes(source.root.plain().get("pusher"), ("pusher",)):
        most = max(_numbers(speed), default=SPEEDS[0])
        if place == ("pusher", "limits", "speed") and most > SPEEDS[1]:
            found.append(source.finding(place, f'is {most:g} m/s: mm/s? write "{most:g} mm/s" if so'))
        elif place == ("pusher", "limits", "speed") and most < SPEEDS[0]:
            found.append(source.finding(place, f"is {1e3 * most:g} mm/s: m/s? a push takes hours"))
    return tuple(found)


def _nodes(stated: object, place: Place = ()) -> Iterator[tuple[Place, object]]:
    """Yield all that a part of a document holds, itself included, with its place."""
    yield place, stated
    members = stated.items() if isinstance(stated, Mapping) else enumerate(stated) if isinstance(stated, list) else ()
    for key, member in members:
        yield from _nodes(member, (*place, key))


def _numbers(stated: object) -> list[float]:
    if isinstance(stated, list):
        return [number for member in stated for number in _numbers(member)]
    return [float(stated)] if isinstance(stated, int | float) and not isinstance(stated, bool) else []
