"""The messages and words of a log against those that its scenario and its plan lead to.

The run is written once more, from the plan judged and executed anew, and both logs are compared topic by topic and
field by field: a field that is added to a message is compared without anything being said here.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

import numpy as np

from pushplan.logging.check import TOLERANCE, Check
from pushplan.logging.mcap.items import Message
from pushplan.logging.mcap.mcap_file import McapFile
from pushplan.logging.messages import metadata, schemas
from pushplan.logging.messages.fields import Value, flattened
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.messages.schemas import Topic
from pushplan.logging.reader import read_run
from pushplan.logging.writer import RunLogWriter
from pushplan.names import AUTO, COSTS
from pushplan.planners.infeasible.lower_bound import lower_bound
from pushplan.planners.problem.margins import margins_to_try
from pushplan.planners.trajectories import make_trajectory
from pushplan.result import PlanResult
from pushplan.scenario import Scenario
from pushplan.sim.judging import execute, planning_set
from pushplan.tolerance.work_out import tolerance_of

FREE_WORDS = ("crc32", "finished_at", "outcome", "error")
"""Words of `pushplan.result` that nothing else determines, beside those of wall-clock times; `outcome` is judged."""


def verify_file(path: Path) -> list[Check]:
    """Compare every topic and word of a log that follows from its scenario and plan.

    Raises:
        PushplanError: When the log cannot be read, or its plan cannot be executed at all.
    """
    run = read_run(path, recover=True)
    if run.plan is None or run.plan.trajectory is None:
        return []
    whole = not run.losses and metadata.RECOVERY not in run.words
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder) / "again.mcap"
        write_again(run, again)
        checks = [check for topic in schemas.TOPICS for check in compare_topic(topic, path, again, whole)]
        return [*checks, *_words(run, read_run(again))] if whole else checks


def write_again(run: RecordedRun, path: Path) -> None:
    """Write the log that a run's scenario and plan lead to."""
    plan = _planned_again(run)
    execution = execute(run.scenario, plan)
    if execution is not None and run.execution is not None and run.execution.dynamic_margins is None:
        execution = replace(execution, dynamic_margins=None)  # a log of an older version
    with RunLogWriter.create(path, run.scenario, {}, run.words.get(metadata.RUN)) as log:
        log.plan(plan)
        if execution is not None and run.execution is not None:
            log.execution(execution)
        log.finish("solved" if plan.solved else "unsolved")


def _planned_again(run: RecordedRun) -> PlanResult:
    """Return the plan with everything in it that follows from the scenario, the settings and the path."""
    plan, words = run.plan, run.words.get(metadata.RUN, {})
    assert plan is not None
    settled = replace(
        plan,
        solved=plan.path is not None,
        reason="" if plan.path is not None else plan.reason,
    )
    if plan.path is None or plan.trajectory is None:
        return settled
    scenario = as_told(run.scenario, words)
    stable = planning_set(scenario, settled.stable_set)
    margins = margins_to_try(scenario, stable)
    margin = plan.margin if plan.margin in margins else margins[0]  # a lower one only the search can tell
    if plan.margin is not None:
        settled = replace(settled, margin_asked=margins[0], margin=margin, objective=scenario.planner.cost)
    scenario = scenario.with_margin(margin)
    trajectory = plan.trajectory
    if not timed_by_other_rules(scenario, plan):
        trajectory = make_trajectory(scenario, plan.path, stable, trajectory.rate)
    return replace(
        settled,
        trajectory=trajectory,
        tolerance=None if plan.tolerance is None else tolerance_of(scenario.chain, trajectory),
        min_margin=float(stable.margin(plan.path.twists).min()) if len(plan.path.twists) else None,
        lower_bound=None if plan.lower_bound is None else lower_bound(scenario, plan.path.cost),
        diagnosis=(),
        approximate_path=None,
        approximate_error=None,
    )


def timed_by_other_rules(scenario: Scenario, plan: PlanResult) -> bool:
    """Tell whether an older version timed a plan with inertia: contacts kept no margin then."""
    return plan.margin is None and scenario.chain.pusher.limits.contact == "dynamic"


def as_told(scenario: Scenario, words: Mapping[str, str]) -> Scenario:
    """Return the scenario with the cost and the margin that the run was told."""
    cost, margin = words.get("cost"), words.get("margin")
    if cost in COSTS:
        scenario = replace(scenario, planner=replace(scenario.planner, cost=cost))
    if margin is not None and margin != AUTO:
        return scenario.with_margin(float(margin))
    return scenario


def compare_topic(topic: Topic, recorded: Path, again: Path, whole: bool) -> Iterator[Check]:
    """Compare the messages on a topic; of a log that lost some, those that are there."""
    if not whole and topic in (schemas.EXECUTION, schemas.EXECUTION_END):
        return
    worst: dict[str, Check] = {topic.name: Check(topic.name, 0.0)}
    for first, second in _pairs(topic, recorded, again, whole):
        if first is None or second is None:
            side = "missing in the log" if first is None else "not to be in the log"
            worst[topic.name] = Check(topic.name, math.inf, what=f"a message is {side}")
            break
        if first.time != second.time:
            _raise(
                worst,
                Check(f"{topic.name} time", 1e-9 * abs(first.time - second.time), time=1e-9 * second.time),
            )
        if first.data != second.data:
            for check in _message(topic, first, second):
                _raise(worst, check)
    yield from worst.values()


def _raise(worst: dict[str, Check], check: Check) -> None:
    """Keep the largest difference of each quantity; one that is no number counts as the largest."""
    before = worst.get(check.quantity)
    if before is None or not check.difference <= before.difference:
        worst[check.quantity] = check


def _pairs(
    topic: Topic, recorded: Path, again: Path, whole: bool
) -> Iterator[tuple[Message | None, Message | None]]:
    first, second = _messages(topic, recorded), _messages(topic, again)
    if topic is schemas.LOG:  # others may have written lines of their own
        texts = {_text(topic, message): message for message in first}
        yield from ((texts.get(_text(topic, message)), message) for message in second if whole)
    elif whole:
        yield from zip_longest(first, second)
    else:
        known = {message.time: message for message in second}
        yield from ((message, known[message.time]) for message in first if message.time in known)


def _text(topic: Topic, message: Message) -> str:
    return str(topic.message.FromString(bytes(message.data)).message)


def _messages(topic: Topic, path: Path) -> Iterator[Message]:
    items = McapFile(path, recover=True, topics=(topic.name,)).items()
    return (item for item in items if isinstance(item, Message) and item.topic == topic.name)


def _message(topic: Topic, first: Message, second: Message) -> Iterator[Check]:
    fields, expected = (flattened(topic.message.FromString(bytes(one.data))) for one in (first, second))
    for name in {**fields, **expected}:
        nothing: Value = np.zeros(0) if isinstance({**fields, **expected}[name], np.ndarray) else ()
        difference, tolerance, what = _difference(fields.get(name, nothing), expected.get(name, nothing))
        yield Check(f"{topic.name} {name}", difference, tolerance, 1e-9 * second.time, what)


def _difference(first: Value, second: Value) -> tuple[float, float, str]:
    """Return how far two values are apart, what would pass, and the difference in words if it is no number."""
    if len(first) != len(second):
        return math.inf, 0.0, f"{len(first)} values instead of {len(second)}"
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        with np.errstate(invalid="ignore"):
            apart = np.where(first == second, 0.0, np.abs(first - second))
        scale = max(1.0, float(np.abs(second).max(initial=0.0)))
        return float(apart.max(initial=0.0)), TOLERANCE * scale, ""
    if first == second:
        return 0.0, 0.0, ""
    found, expected = next((a, b) for a, b in zip(first, second, strict=True) if a != b)
    return math.inf, 0.0, f"{found!r} instead of {expected!r}"


def _words(run: RecordedRun, again: RecordedRun) -> Iterator[Check]:
    """Compare the metadata, and what they say of the scenario."""
    assert run.plan is not None
    said = run.words[metadata.RUN]
    fresh = metadata.run_words(run.scenario, {})
    for key in ("format", "scenario", "scenario_sha256"):
        yield _word(f"{metadata.RUN} {key}", said.get(key), fresh[key])
    settings = {"planner": run.plan.planner, "set": run.plan.stable_set, "seed": str(run.plan.seed)}
    for key, expected in settings.items():
        if key in said:
            yield _word(f"{metadata.RUN} {key}", said[key], expected)
    if "cost" in said:
        what = "" if said["cost"] in COSTS else f"{said['cost']!r} is none of {', '.join(COSTS)}"
        yield Check(f"{metadata.RUN} cost", math.inf if what else 0.0, what=what)
    result, made = run.words[metadata.RESULT], again.words[metadata.RESULT]
    planning = run.words[metadata.PLANNING]
    for key in {**result, **made}:
        if key in FREE_WORDS or (key.endswith("_s") and key not in planning):
            continue
        yield _word(f"{metadata.RESULT} {key}", result.get(key), made.get(key))
    if run.outcome not in ("failed", "interrupted", "unfinished"):
        yield _word(f"{metadata.RESULT} outcome", run.outcome, again.outcome)


def _word(quantity: str, said: str | None, expected: str | None) -> Check:
    try:
        first, second = float(said or ""), float(expected or "")
    except ValueError:
        same = said == expected
        return Check(
            quantity, 0.0 if same else math.inf, what="" if same else f"{said!r} instead of {expected!r}"
        )
    return Check(quantity, 0.0 if first == second else abs(first - second), TOLERANCE * max(1.0, abs(second)))
