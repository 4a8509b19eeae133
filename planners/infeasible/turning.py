"""Diagnoses from the chain's turns: none, to one side only, or too wide for the room."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pushplan.core.problem import find_words
from pushplan.geometry import se2
from pushplan.mechanics.chain import Drive
from pushplan.mechanics.sphere import TurningRadii
from pushplan.planners.controls import control_segments, drive_radii, segment_ends, smallest_radii, steering_families
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.path import PushPath
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

SECTORS = 64
"""Maximum number of sectors of the direction of v."""

SAMPLES = 65
"""Number of turning rates at which a wheeled drive is sampled."""

SAME_DIRECTION = 1e-9
"""Difference in direction (rad) below which both ends of a segment lie on one meridian."""


class Turns(NamedTuple):
    """Turns of the stable twists.

    Attributes:
        left: (k, 4) sectors of the direction of v in turns to the left: lower and upper bound of |v| at |omega| = 1
            (m, infinite if v can go straight), middle and half width of the sector (rad).
        right: (k, 4) sectors of turns to the right.
        straight: Least and largest direction of straight twists, rad; None if there are none.
    """

    left: FloatArray
    right: FloatArray
    straight: tuple[float, float] | None


def turns_of(segments: FloatArray) -> Turns:
    """Return the turns of the twists on segments (k, 6) and between them; see `controls`."""
    first, last = segments[:, :3], segments[:, 3:]
    if np.all(np.abs(se2.wrap_angle(_direction(last) - _direction(first))) < SAME_DIRECTION):
        return _turns_of_meridians(segments)
    return _turns_of_family(segments)


def _direction(twists: FloatArray) -> FloatArray:
    """Return the directions of v of twists."""
    return np.asarray(np.arctan2(twists[..., 1], twists[..., 0]))


def _turns_of_meridians(segments: FloatArray) -> Turns:
    """Return the turns of an omnidirectional pusher. The ends of a meridian give |v| at |omega| = 1."""
    direction = np.unwrap(_direction(segments[:, :3]))
    order = np.argsort(direction)
    direction, segments = direction[order], segments[order]
    steps = np.diff(direction)
    # The set extends beyond the outermost meridians by less than one step. A drive can have a single direction.
    step = float(steps[steps > SAME_DIRECTION].min()) if direction[-1] - direction[0] > SAME_DIRECTION else 0.0
    left, right = (_meridian_sectors(direction, segments, side, step) for side in (1.0, -1.0))
    able = direction[segments[:, 2] * segments[:, 5] <= 0.0]
    return Turns(left, right, _straight(left, right, able - step, able + step))


def _straight(left: FloatArray, right: FloatArray, low: FloatArray, high: FloatArray) -> tuple[float, float] | None:
    """Return the range of straight directions: between low and high, and in sectors without a widest turn."""
    turns = np.concatenate([left, right])
    turns = turns[np.isinf(turns[:, 1])]
    low, high = np.append(low, turns[:, 2] - turns[:, 3]), np.append(high, turns[:, 2] + turns[:, 3])
    return (float(low.min()), float(high.max())) if len(low) else None


def _meridian_sectors(direction: FloatArray, segments: FloatArray, side: float, step: float) -> FloatArray:
    """Return the sectors of turns to a side, between neighbouring meridians and beyond the outermost ones."""
    bends = side * segments[:, (2, 5)] / np.hypot(segments[:, (0, 3)], segments[:, (1, 4)])
    able = bends.max(axis=1) > 0.0
    if not able.any():
        return np.zeros((0, 4))
    direction, most, least = direction[able], bends[able].max(axis=1), bends[able].min(axis=1)
    half = 0.5 * np.diff(np.concatenate([[direction[0] - step], direction, [direction[-1] + step]]))
    middle = np.concatenate([[direction[0] - step], direction]) + half
    tightest, widest = _between(most), -_between(-least)
    with np.errstate(divide="ignore"):
        return _together(np.column_stack([1.0 / tightest, 1.0 / np.maximum(widest, 0.0), middle, half]))


def _between(bend: FloatArray) -> FloatArray:
    """Return upper bounds (k + 1,) of the bend between meridians with bends (k,), and beyond them.

    The boundary can have a corner between two meridians. It lies below the extrapolation from either side.
    """
    bend = np.concatenate([bend[:1], bend, bend[-1:]])
    change = np.diff(bend, prepend=bend[0], append=bend[-1])
    return np.asarray(np.maximum(bend[:-1], bend[1:]) + np.maximum(0.0, np.maximum(change[:-2], -change[2:])))


def _turns_of_family(segments: FloatArray) -> Turns:
    """Return the turns of a wheeled drive, sampled on its straight lines of twists."""
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    rows = [(1.0 - share) * row[:3] + share * row[3:] for row in segments]
    left, right = (np.concatenate([_family_sectors(row, side) for row in rows]) for side in (1.0, -1.0))
    still = np.concatenate([_direction(row)[np.abs(row[:, 2]) < SAME_DIRECTION] for row in rows])
    return Turns(left, right, _straight(left, right, still, still))


def _family_sectors(twists: FloatArray, side: float) -> FloatArray:
    """Return the sectors of turns to a side between neighbouring twists (m, 3) on a straight line."""
    speed, direction = np.hypot(twists[:, 0], twists[:, 1]), np.unwrap(_direction(twists))
    rate = np.maximum(side * twists[:, 2], 0.0)
    most, least = np.maximum(rate[:-1], rate[1:]), np.minimum(rate[:-1], rate[1:])
    # Between two twists on a line, |v| is at least the smaller one minus their difference.
    slowest = np.maximum(np.minimum(speed[:-1], speed[1:]) - np.abs(np.diff(speed)), 0.0)
    able = most > SAME_DIRECTION
    middle, half = 0.5 * (direction[:-1] + direction[1:]), 0.5 * np.abs(np.diff(direction))
    with np.errstate(divide="ignore"):
        radii = slowest[able] / most[able], np.maximum(speed[:-1], speed[1:])[able] / least[able]
    return np.column_stack([*radii, middle[able], half[able]])


def _together(sectors: FloatArray) -> FloatArray:
    """Return sectors (k, 4) merged into at most `SECTORS` wider ones, each with the bounds of all its members."""
    if len(sectors) <= SECTORS:
        return sectors
    low, high = sectors[:, 2] - sectors[:, 3], sectors[:, 2] + sectors[:, 3]
    firsts = np.linspace(0, len(sectors), SECTORS, endpoint=False).astype(int)
    lows, highs = np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)
    radii = np.minimum.reduceat(sectors[:, 0], firsts), np.maximum.reduceat(sectors[:, 1], firsts)
    return np.column_stack([*radii, 0.5 * (lows + highs), 0.5 * (highs - lows)])


SAME_ANGLE = 1e-9
"""Difference (rad) below which two headings or directions are equal."""


def turning_faults(scenario: Scenario, stable: StableSet, segments: FloatArray) -> list[Diagnosis]:
    """Return the diagnoses that explain a missing path by the chain's turns.

    Args:
        scenario: The problem.
        stable: Stable set of the pushes.
        segments: (k, 6) stable twists that the drive can make; see `controls`.
    """
    ends = segment_ends(segments)
    goal = scenario.goal.pose_chain
    turn = float(se2.wrap_angle(goal[2] - scenario.start[2]))
    if (ends[:, 2] == 0.0).all():
        return _no_turning(scenario, stable, turn)
    radii = smallest_radii(segments)
    return [*_one_sided(scenario, stable, turn, radii), *_too_wide(scenario, stable, turn, radii, segments)]


def tightest_turn(scenario: Scenario, stable: StableSet, segments: FloatArray) -> str:
    """Return a clause about the tightest turns with and without the drive; "" for an omnidirectional drive."""
    of_set = _of_set(scenario, stable)
    if of_set is None:
        return ""
    made, alone = _drive_words(scenario, f"{min(of_set):.3g} m", stable)
    return f"; the tightest turn{made} has a radius of {min(smallest_radii(segments)):.3g} m{alone}"


def _too_wide(
    scenario: Scenario, stable: StableSet, turn: float, radii: TurningRadii, segments: FloatArray
) -> Iterator[Diagnosis]:
    """Yield the diagnosis that the tightest circle or every exact steering path leaves the workspace."""
    area, radius = scenario.workspace, min(radii)
    if area is None:
        return
    across = min(area.xmax - area.xmin, area.ymax - area.ymin)
    if abs(turn) > SAME_ANGLE and 2.0 * radius > across:
        what = f"makes a circle of {2.0 * radius:.3g} m, wider than the workspace ({across:.3g} m)"
    elif math.isfinite(max(radii)) and not a_word_fits(scenario, segments):
        what = "leaves the workspace on every steering path of three arcs to the goal"
    else:
        return
    of_set = _of_set(scenario, stable)
    made, alone = ("", "") if of_set is None else _drive_words(scenario, f"{min(of_set):.3g} m", stable)
    text = f"perhaps the turns are too wide: the tightest one{made}, of radius {radius:.3g} m{alone}, {what}"
    yield Diagnosis("wide turns", text, False, {"radius": radius, "across": across, **_numbers(of_set)})


def a_word_fits(scenario: Scenario, segments: FloatArray) -> bool:
    """Return whether an exact steering path from start to goal stays in the workspace, ignoring obstacles."""
    area = scenario.workspace
    corners = np.concatenate([moving.outline for moving in scenario.chain.bodies])
    for family in steering_families(segments):
        for word in find_words(family, scenario.start, scenario.goal.pose_chain):
            if area is None:
                return True
            path = PushPath(scenario.start, family[word[1:4].astype(int)], word[4:])
            poses = path.sampled(0.1)[:, None]
            across, upward = np.moveaxis(poses[..., :2] + se2.rotate(poses[..., 2], corners), -1, 0)
            inside = (across > area.xmin) & (across < area.xmax) & (upward > area.ymin) & (upward < area.ymax)
            if inside.all():
                return True
    return False


def _of_set(scenario: Scenario, stable: StableSet) -> TurningRadii | None:
    """Return the turning radii of the set without the drive, to about 1 %; None for an omnidirectional drive."""
    if scenario.chain.pusher.drive.axle is None:
        return None
    # Few meridians are enough for a message. The exact radii take seconds if loads are intervals.
    return smallest_radii(control_segments(stable, Drive(), scenario.required_margin, 128))


def _drive_words(scenario: Scenario, of_set: str, stable: StableSet) -> tuple[str, str]:
    """Return the phrases for the turns of a drive, and for those without it or with its axle at the contact."""
    drive = scenario.chain.pusher.drive
    near = replace(drive, axle=None if drive.axle is None else drive.axle * [0.0, 1.0, 1.0])
    radius = min(drive_radii(stable, near, scenario.required_margin))
    closer = f"; with the axle at the contact: {radius:.3g} m" if math.isfinite(radius) else ""
    return f" that the {drive.kind} drive can make", f" (without the drive: {of_set}{closer})"


def _numbers(of_set: TurningRadii | None) -> dict[str, float]:
    if of_set is None:
        return {}
    return {f"{side}_of_set": r for side, r in of_set._asdict().items() if math.isfinite(r)}


def _no_turning(scenario: Scenario, stable: StableSet, turn: float) -> list[Diagnosis]:
    """Return the diagnoses without turns: a fixed heading, or a goal outside the cone of straight pushes."""
    made = "" if scenario.chain.pusher.drive.axle is None else _drive_words(scenario, "", stable)[0]
    set_name = f"no push of the set {stable.name}{made} turns the chain"
    if abs(turn) > SAME_ANGLE:
        text = f"the goal cannot be reached: {set_name}, and it needs a turn of {math.degrees(turn):.4g} deg"
        return [Diagnosis("heading", text, True, {"turn": turn})]
    cone = stable.translation_cone(scenario.required_margin)
    if cone is None or scenario.chain.pusher.drive.axle is not None:
        return []
    away = scenario.goal.pose_chain[:2] - scenario.start[:2]
    lowest, highest = np.arctan2(cone[:, 1], cone[:, 0])
    direction = math.atan2(away[1], away[0]) - scenario.start[2]
    opening = (highest - lowest) % (2.0 * math.pi)
    if opening >= math.pi or (direction - lowest) % (2.0 * math.pi) <= opening + SAME_ANGLE:
        return []
    aside = float(se2.wrap_angle(direction))
    text = (
        f"the goal cannot be reached: {set_name}, straight pushes go {math.degrees(lowest):.4g} to "
        f"{math.degrees(highest):.4g} deg from straight ahead, and the goal lies at {math.degrees(aside):.4g} deg"
    )
    numbers = {"direction": aside, "lowest": float(lowest), "highest": float(highest)}
    return [Diagnosis("direction", text, True, numbers)]


def _one_sided(scenario: Scenario, stable: StableSet, turn: float, radii: TurningRadii) -> list[Diagnosis]:
    """Return the diagnosis that the goal needs a turn to the side to which the chain does not turn."""
    if math.isfinite(max(radii)):
        return []
    able, unable, sign = ("left", "right", -1.0) if math.isfinite(radii.left) else ("right", "left", 1.0)
    away = scenario.goal.pose_chain[:2] - scenario.start[:2]
    aside = math.cos(scenario.start[2]) * away[1] - math.sin(scenario.start[2]) * away[0]
    if sign * turn <= SAME_ANGLE and sign * aside <= SAME_ANGLE:
        return []
    radius, of_set = min(radii), _of_set(scenario, stable)
    made, alone = ("", "") if of_set is None else _drive_words(scenario, _sides(of_set), stable)
    text = (
        f"perhaps the turns are one-sided: every stable turn{made} goes to the {able}, with a radius of "
        f"{radius:.3g} m or more{alone}, but the goal lies or turns to the {unable}"
    )
    numbers = {"radius": radius, "turn": turn, "aside": aside, **_numbers(of_set)}
    return [Diagnosis("one-sided", text, False, numbers)]


def _sides(radii: TurningRadii) -> str:
    sides = [f"{r:.3g} m to the {side}" for side, r in radii._asdict().items() if math.isfinite(r)]
    return " and ".join(sides) or "none"
