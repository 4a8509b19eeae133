"""Checks beyond reading a scenario: empty stable sets, and plain numbers that are probably in another unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pushplan.errors import Finding, PushplanError, TippingError
from pushplan.mechanics.chain import PLATE
from pushplan.scenario.model import Scenario
from pushplan.scenario.source import Place, Source
from pushplan.util.names import AUTO, KNOWN_LOAD_SETS, STABLE_SETS

LONGEST = 20.0
"""Largest side, or distance of an axle, that is plausible as a plain number, m."""

SPEEDS = 1e-3, 5.0
"""Lowest and highest plausible speed, m/s."""


def check_scenario(scenario: Scenario) -> tuple[Finding, ...]:
    """Return an error if the stable set of `scenario.stability` is empty or needs loads that are not specified.

    `load_scenario` leaves out this check because it takes longer. For multi-push plans only the loads are checked,
    because the planner can choose other contacts than the one in the file.
    """
    unknown = [obj.name for obj in scenario.chain.objects if not obj.support.known]
    if unknown and scenario.stability.set in KNOWN_LOAD_SETS:
        others = ", ".join(other for other in STABLE_SETS if other not in KNOWN_LOAD_SETS)
        what = f"'{scenario.stability.set}' needs the pressure distribution on the floor, which is not known for "
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
    """Return a finding about a place in the file; without a file, it has no line."""
    return (
        Finding(".".join(map(str, place)), what) if scenario.origin is None else scenario.origin.finding(place, what)
    )


def length_question(source: Source) -> Finding | None:
    """Return a finding for the first plain number that is too long in m and is probably in mm; None without one."""
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
            text = f'is {length:g} m {what}: plain numbers are in m; for mm, write "{length:g} mm" everywhere'
            return source.finding(place, text)
    return None


def questions(source: Source) -> tuple[Finding, ...]:
    """Return a finding for each number that is probably in another unit."""
    length = length_question(source)
    found = [] if length is None else [length]
    for place, speed in _nodes(source.root.plain().get("pusher"), ("pusher",)):
        most = max(_numbers(speed), default=SPEEDS[0])
        if place == ("pusher", "limits", "speed") and most > SPEEDS[1]:
            found.append(source.finding(place, f'is {most:g} m/s; for mm/s, write "{most:g} mm/s"'))
        elif place == ("pusher", "limits", "speed") and most < SPEEDS[0]:
            found.append(source.finding(place, f"is {1e3 * most:g} mm/s: a push takes hours; check the unit"))
    return tuple(found)


def _nodes(stated: object, place: Place = ()) -> Iterator[tuple[Place, object]]:
    """Yield a part of a document and all its members, each with its place."""
    yield place, stated
    members = stated.items() if isinstance(stated, Mapping) else enumerate(stated) if isinstance(stated, list) else ()
    for key, member in members:
        yield from _nodes(member, (*place, key))


def _numbers(stated: object) -> list[float]:
    if isinstance(stated, list):
        return [number for member in stated for number in _numbers(member)]
    return [float(stated)] if isinstance(stated, int | float) and not isinstance(stated, bool) else []
