"""Why no plan of several pushes was found, in the words of a diagnosis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pushplan.planners.collision.separation import separation
from pushplan.planners.multi.room import Contact, PushRoom, Question, joined, robot_at
from pushplan.planners.multi.search import Found
from pushplan.plans.result import Diagnosis
from pushplan.util.arrays import FloatArray

BOXED_IN = "boxed in"


def reasons(room: PushRoom, question: Question, found: Found) -> tuple[Diagnosis, ...]:
    """Return why a search found nothing, most certain first."""
    told = tuple(_reasons(room, question, found))
    order = sorted(told, key=lambda reason: not reason.proven)
    return tuple(order) or (
        Diagnosis(
            "time", f"the search was not over after {found.looked_at} pushes and ways of the robot", False
        ),
    )


def _reasons(room: PushRoom, question: Question, found: Found) -> Iterator[Diagnosis]:
    usable = [contact for contact, begins in zip(room.contacts, found.begins, strict=True) if begins]
    if not usable:
        what = "at the start, the robot has no room to drive up to any face that it may push"
        yield Diagnosis(BOXED_IN, what, _all_taken(room, question.load[None]))
        return
    faces = ", ".join(dict.fromkeys(contact.mode.place.face for contact in usable))
    if not (found.begins & found.leaves).any():
        what = f"at the start, the robot can drive up to {faces} only, and from there the load is against something"
        # If every settling push ends in something, no longer one is free either.
        against = all(_ends_in_something(contact, question) for contact in usable)
        yield Diagnosis(BOXED_IN, what, against)
        return
    if not found.ends.any():
        what = "at the goal, the robot has no room to push the load there from any face, and to back off"
        yield Diagnosis(BOXED_IN, what, _all_taken(room, question.goals))
        return
    if not found.arrives:
        what = f"the robot found no way to where it would push first ({faces})"
        yield Diagnosis(BOXED_IN, what, False)


def _ends_in_something(contact: Contact, question: Question) -> bool:
    mode = contact.packed
    x, y, theta = _contact_at(contact, question)
    c, s = np.cos(theta), np.sin(theta)
    dx, dy = mode.settle * mode.settling[:2]
    return bool(separation(contact.scene, x + c * dx - s * dy, y + s * dx + c * dy, theta, 1.0) <= 0.0)


def _contact_at(contact: Contact, question: Question) -> tuple[float, float, float]:
    x, y, theta = joined(question.load, contact.packed.contact)
    return float(x), float(y), float(theta)


def _all_taken(room: PushRoom, loads: FloatArray) -> bool:
    """Tell whether the robot would overlap something at every contact, with the load at any of the poses (k, 3)."""
    poses = [robot_at(contact.packed, load, 0.0) for contact in room.contacts for load in loads]
    return all(separation(room.robot, p[0], p[1], p[2], 1.0) < room.scenario.clearance for p in poses)
