"""Verifies a run log: validates its plan in its scenario, recomputes its numbers and executes it again.

All data that scenario and plan determine are compared. The report lists the data that are not compared.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np

import pushplan.logging.metadata as metadata
from pushplan.closed_loop import CONTROL, check_closed_loop
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import pose_error
from pushplan.logging.codec import load_of
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.verify import TOLERANCE, Check, VerifyReport, verify
from pushplan.mechanics.faces import places
from pushplan.planners.controls import MOST_MARGIN, margins_to_try
from pushplan.planners.multi.hands import MARGIN
from pushplan.planners.multi.multi_push import plan_cost
from pushplan.planners.push_search import bound_of_plan
from pushplan.planners.timing.blending import time_segments
from pushplan.planners.validator import Validator
from pushplan.plans.execution import Execution
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan, reason_of
from pushplan.plans.segment import Segment, end_of
from pushplan.scenario.goals import EXACT
from pushplan.scenario.model import Scenario
from pushplan.sim.kinematic import execute
from pushplan.sim.robustness import least_robustness
from pushplan.trial import TRIAL, check_trials, executed_again
from pushplan.util.names import APPROACH, PUSH

NOT_DECIDED = "the name, the seed and the remarks of the planner"
"""Parts of a plan that the rest of the log does not determine."""

OTHERS = "the ends of the Monte Carlo samples (not executed by pushplan's own simulator)"

ROUNDING = 1e-6
"""Relative tolerance of recomputed numbers and motions, which iterative methods compute."""


def verify_log(path: Path | str) -> VerifyReport:
    """Read a log once, recompute its data from its scenario and plan, and compare.

    Raises:
        RunLogError: If the log cannot be read.
        PushplanError: If the recorded plan cannot be executed at all.
    """
    return verify_run(load_run(path, messages=True))


def verify_run(run: RecordedRun) -> VerifyReport:
    """Recompute the data of a run from its plan or measurements, and compare. `run` must contain its messages.

    Raises:
        PushplanError: If the recorded plan cannot be executed at all.
    """
    report = verify(run, execute_again)
    checks, left_out = list(report.checks), list(report.not_compared)
    if run.plan is not None:
        checking = _PlanChecks(run, run.plan, not report.versions)
        try:
            checks = [*checking.checks(), *checks]
        except PushplanError as error:  # a load that is not in the scenario or cannot be pushed
            checks = [_differs("plan", str(error)), *checks]
        left_out += checking.left_out
    if run.feedback is not None and CONTROL in run.fields and run.execution is not None and run.plan is not None:
        checks = [*check_closed_loop(run), *checks]
    elif TRIAL in run.fields:
        trials = check_trials(run)
        left_out += [OTHERS] if run.trials and not trials else []
        checks = [*trials, *checks]
    return replace(report, checks=tuple(checks), not_compared=tuple(left_out))


def execute_again(run: RecordedRun) -> Execution | None:
    """Execute a recorded plan again; return None for closed loops and for slip in a world that no log holds."""
    execution, plan = run.execution, run.plan
    if TRIAL in run.fields and execution is not None:
        return executed_again(run)
    slipped = execution is not None and (execution.wrenches is not None or run.feedback is not None)
    if plan is None or plan.trajectory is None or slipped:
        return None
    return execute(plan.scenario, plan.segments, plan.stable_set)


class _PlanChecks:
    """Validates the plan of a run in the run's scenario and recomputes its numbers.

    Args:
        run: The run with the plan.
        plan: The plan.
        same: Whether all packages have the recorded versions.

    Attributes:
        left_out: Descriptions of the data that are not compared.
    """

    def __init__(self, run: RecordedRun, plan: Plan, same: bool) -> None:
        self._run, self._plan, self._fields = run, plan, run.fields.get(metadata.RUN, {})
        # Another commit can time paths differently and prove other bounds.
        self._same = same and self._fields.get("git", "") == metadata.git_commit()
        # A closed loop plans more cautiously than the scenario requires: with less friction and more clearance.
        self._watched = CONTROL in run.fields
        self.left_out = [NOT_DECIDED]

    def checks(self) -> Iterator[Check]:
        """Yield the comparisons."""
        run, plan = self._run, self._plan
        try:
            scenario = metadata.settings_in(self._fields).applied(run.scenario)
        except (ValueError, PushplanError) as error:
            yield _differs("settings", str(error))
            return
        yield from self._check_metadata(scenario)
        if not plan.segments or not (plan.solved or plan.undelivered):
            yield from self._check_unsolved(scenario)
            return
        self._scenario = plan.aims(scenario)
        yield from self._check_undelivered(scenario)
        self._own = tuple(replace(s, load=self._own_load(scenario, s.load)) for s in plan.segments)
        self._set = self._set_name(self._own)
        yield from self._check_loads()
        yield from self._check_solution()
        yield from self._check_motion()
        if self._watched and self._is_cautious():
            self.left_out.append("the numbers of a plan that assumes less friction than the scenario")
            return
        yield from self._check_numbers()

    def _is_cautious(self) -> bool:
        """Return whether contacts have less friction in the plan than in the scenario."""
        pairs = zip(self._plan.segments, self._own, strict=True)
        both = [(s.load.chain.contacts, own.load.chain.contacts) for s, own in pairs if s.load and own.load]
        return any(a.friction < b.friction - TOLERANCE for pair in both for a, b in zip(*pair, strict=True))

    def _own_load(self, scenario: Scenario, load: Load | None) -> Load | None:
        """Return the scenario's own load for a recorded load."""
        return None if load is None else load_of(scenario, load.names, load.face, load.offset, load.faces)

    def _check_metadata(self, scenario: Scenario) -> Iterator[Check]:
        """Compare the metadata of the run with scenario and plan."""
        run, plan = self._run, self._plan
        expected = {
            "scenario": scenario.name,
            "scenario_sha256": hashlib.sha256(scenario.source).hexdigest(),
            "planner": plan.planner,
            "set": plan.stable_set,
            "seed": str(plan.seed),
        }
        for name, value in expected.items():
            if name in self._fields and not (name == "seed" and CONTROL in run.fields):
                yield _same(f"{metadata.RUN} {name}", self._fields[name], value)
        yield _same("objective", plan.objective, scenario.planner.cost)
        outcome = run.fields.get(metadata.RESULT, {}).get("outcome")
        if outcome in ("solved", "unsolved"):
            yield _same(f"{metadata.RESULT} outcome", outcome, "solved" if plan.solved else "unsolved")

    def _check_undelivered(self, scenario: Scenario) -> Iterator[Check]:
        """Check that the stated objects, and no others, miss their goals and that the plan's reason names them."""
        plan, named = self._plan, self._plan.undelivered
        end, goals = end_of(scenario, plan.segments), scenario.task.goals
        missed = {
            name for goal in goals if set(goal.names) & set(named) and goal.shortfall(end) for name in goal.names
        }
        yield _same("objects that are not delivered", sorted(missed), sorted(named))
        yield _same("reason", plan.reason, reason_of(named, len(scenario.goals)) if named else "")

    def _check_unsolved(self, scenario: Scenario) -> Iterator[Check]:
        """Check that an unsolved plan has no numbers, and check the error of its nearest path."""
        plan, nearest = self._plan, self._plan.nearest
        self.left_out.append("the reason why there is no plan")
        stated = [plan.cost, plan.robustness, plan.execution, plan.segments or None]
        yield _same("numbers of an unsolved plan", sum(one is not None for one in stated), 0)
        yield _same("reason", bool(plan.reason), True)
        if nearest is None or not scenario.task.held:
            return
        segments = tuple(replace(s, load=self._own_load(scenario, s.load)) for s in nearest.segments)
        end = segments[-1].contact_path.end if segments else scenario.start
        error = pose_error(end, scenario.goal.pose_chain)
        yield Check("error of the nearest path", float(np.abs(np.subtract(error, nearest.error)).max()), EXACT)
        validator, name = Validator(scenario), self._set_name(segments)
        flaws = [validator.flaw_of(segment, name) for segment in segments if name is not None]
        yield _none("nearest path", next(filter(None, flaws), ""))

    def _set_name(self, segments: tuple[Segment, ...]) -> str | None:
        """Return the name of the plan's stable set; None for user code, which a log does not load."""
        name = self._plan.stable_set
        try:
            for segment in segments:
                if segment.load is not None and segment.pushes:
                    segment.load.stable_set(name)
        except PushplanError:
            self.left_out.append(f"the margins in the stable set {name!r}, which is not installed")
            return None
        return name

    def _check_loads(self) -> Iterator[Check]:
        """Compare the recorded loads with those of the scenario."""
        difference = 0.0
        for segment, own in zip(self._plan.segments, self._own, strict=True):
            if segment.load is not None and own.load is not None and segment.load is not own.load:
                difference = max(difference, _apart(segment.load, own.load, self._watched))
        yield Check("objects, contacts and frictions of loads", difference)
        if self._scenario.task.held or self._scenario.task.flush:
            return
        choice, pushes = self._scenario.transport, [s.load for s in self._own if s.kind == PUSH]
        for load in {id(load): load for load in pushes if load is not None}.values():
            chain = next(one.chain for one in choice.loads if load.names[0] in one.names)
            allowed = [(place.face, place.offset) for place in places(chain, choice.faces, choice.offsets)]
            fits = any(face == load.face and abs(aside - load.offset) <= EXACT for face, aside in allowed)
            what = "" if fits else f"{load.face} with {1e3 * load.offset:.3g} mm, which the scenario does not allow"
            yield _none(f"face that pushes {', '.join(load.names)}", what)
        if choice.one_load:
            over = len(self._plan.pushes) - choice.most
            yield Check("pushes beyond pushes.most", max(0.0, float(over)), 0.0)
        off = [abs(s.path.cost - choice.approach) for s in self._own if s.kind == APPROACH]
        yield Check("length of an approach", max(off, default=0.0), EXACT)

    def _check_solution(self) -> Iterator[Check]:
        """Validate the plan, its motion and its paths. The searches do not use this validator."""
        segments, name = self._own, self._set
        if self._set is None:
            # Every twist has a margin above -1; the contacts are checked in the execution instead.
            segments = tuple(replace(segment, margin=-1.0) for segment in segments)
        judge = Validator(self._scenario)
        timed = all(segment.trajectory is not None for segment in segments)
        execution = execute(self._run.scenario, segments, self._plan.stable_set) if timed else None
        yield _none("plan", judge.flaw(segments, execution, name))
        if timed:
            paths = tuple(replace(segment, trajectory=None) for segment in segments)
            yield _none("path", judge.flaw(paths, None, name))

    def _check_motion(self) -> Iterator[Check]:
        """Time the path again and compare the trajectories."""
        difference, timed = 0.0, [s for s in self._own if s.trajectory is not None]
        for segment in timed:
            trajectory = segment.trajectory
            assert trajectory is not None
            ends = (trajectory.start, segment.path.start), (trajectory.break_poses[-1], segment.path.end)
            difference = max(difference, *(max(pose_error(*pair)) for pair in ends))
        yield Check("ends of the trajectory and of the path", difference, EXACT)
        if not timed or self._watched or not self._same or self._set is None:
            self.left_out += ["the timing of the path (other version, closed loop or unknown set)"] if timed else []
            return
        rate = timed[0].trajectory.rate if timed[0].trajectory is not None else 0.0
        paths = tuple(replace(segment, trajectory=None) for segment in self._own)
        try:
            again = time_segments(self._scenario, paths, rate, self._plan.stable_set)
        except PushplanError as error:
            yield _differs("trajectory", f"the path cannot be timed: {error}")
            return
        yield Check("trajectory", max(_motion_apart(*pair) for pair in zip(self._own, again, strict=True)), ROUNDING)

    def _check_numbers(self) -> Iterator[Check]:
        """Recompute the plan's numbers and compare them."""
        plan, scenario, segments = self._plan, self._scenario, self._own
        single = bool(scenario.task.held)
        yield _number("cost", plan.cost, segments[0].cost if single else plan_cost(scenario, segments))
        timed = plan.trajectory is not None
        again = least_robustness(segments) if timed else None
        stated = plan.robustness
        if stated is None or again is None:
            yield _same("robustness", stated is None, again is None)
        else:
            pairs = zip(astuple(stated), astuple(again), strict=True)
            yield from (_number("robustness", *pair) for pair in pairs)
        if self._set is None:
            return
        yield from self._check_margins(scenario, self._set)
        known = self._same and single and not self._watched
        if not known:
            self.left_out += [] if plan.lower_bound is None else ["the lower bound"]
            return
        assert segments[0].load is not None
        posed = scenario.with_margin(segments[0].margin)
        bound = bound_of_plan(posed, segments[0].load.stable_set(self._set), segments)
        yield _number("lower bound", plan.lower_bound, bound)

    def _check_margins(self, scenario: Scenario, name: str) -> Iterator[Check]:
        """Compare the stated margins and the margins of the pushes with those that the planner tries."""
        plan, row = self._plan, self._scenario.task.flush
        pushes = [s for s in self._own if s.pushes and s.load is not None]
        firsts, wrong = list[float](), ""
        for push in pushes:
            assert push.load is not None
            stable, problem = push.load.stable_set(name), push.load.problem.with_margin(scenario.stability.margin)
            tries = [
                margins_to_try(problem, stable, most) for most in ((MOST_MARGIN, MARGIN) if row else (MOST_MARGIN,))
            ]
            firsts += [one[0] for one in tries]
            if all(abs(push.margin - margin) > TOLERANCE for one in tries for margin in one):
                wrong = wrong or f"a push has the margin {push.margin:.6g}, which the planner does not try"
            if push.trajectory is not None:
                least = float(stable.margin(push.contact_path.twists).min())
                yield _number("smallest margin of a push", push.min_margin, least)
        yield _none("margins of pushes", wrong)
        stated = (("margin", plan.margin, [s.margin for s in pushes]), ("margin asked", plan.margin_asked, firsts))
        for what, value, known in stated:
            # Objects that were moved out of the way of a row do not count.
            yield _number(what, value, min(known, key=lambda one: abs(one - (value or 0.0))) if row else min(known))


def _apart(load: Load, own: Load, watched: bool) -> float:
    """Return the largest difference of two loads; in a closed loop, less friction than in the scenario is allowed."""
    first, second = load.chain, own.chain
    one, other = (
        np.concatenate(
            [chain.pusher.plate_pose, chain.places.ravel(), *((c.right, c.left) for c in chain.contacts)], axis=None
        )
        for chain in (first, second)
    )
    more = np.array([a.friction - b.friction for a, b in zip(first.contacts, second.contacts, strict=True)])
    return max(float(np.abs(one - other).max()), float((more if watched else np.abs(more)).max()))


def _motion_apart(first: Segment, second: Segment) -> float:
    """Return the largest difference of two timed segments, in SI units."""
    one, other = first.trajectory, second.trajectory
    if one is None or other is None or one.coefficients.shape != other.coefficients.shape:
        return math.inf
    names = ("start", "breaks", "coefficients", "arc", "base")
    return max(float(np.abs(getattr(one, name) - getattr(other, name)).max(initial=0.0)) for name in names)


def _differs(quantity: str, what: str) -> Check:
    return Check(quantity, math.inf, what=what)


def _none(quantity: str, flaw: str) -> Check:
    """Return a check that passes if `flaw` is empty."""
    return _differs(quantity, flaw) if flaw else Check(quantity, 0.0)


def _same(quantity: str, stated: object, again: object) -> Check:
    return _none(quantity, "" if stated == again else f"{stated!r} instead of {again!r}")


def _number(quantity: str, stated: float | None, again: float | None) -> Check:
    if stated is None or again is None:
        return _same(quantity, stated, again)
    return Check(quantity, abs(stated - again), ROUNDING * max(1.0, abs(again)))
