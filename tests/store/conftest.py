"""Logs of every kind: one push, multi-push, rearrangement, closed loop, trials, and one without a plan."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import there
from kinds import FAST
from mcap import records
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from pushplan.logging.writer import RunLogWriter
from pushplan.planner import Planner
from pushplan.plans.execution import Execution, TrialEnd
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.run import Event, Feedback, Measured, Replan
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.sim.trials import execute_trials
from pushplan.trial import TRIAL

KINDS = ("push", "multi-push", "rearrangement", "closed loop", "trial", "no plan")


@dataclass(frozen=True)
class Case:
    """Contents of a log."""

    plan: Plan
    execution: Execution | None = None
    feedback: Feedback | None = None
    trials: tuple[TrialEnd, ...] = ()
    notes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def write(self, path: Path) -> Path:
        settings = {"planner": self.plan.planner, "set": self.plan.stable_set, "seed": self.plan.seed}
        with RunLogWriter.create(path, self.plan.scenario, settings) as log:
            for name, words in self.notes.items():
                log.note(name, words)
            log.plan(self.plan)
            for end in self.trials:
                log.trial(end)
            if self.execution is not None and self.feedback is not None:
                log.feedback(self.feedback)
                log.execution(self.execution)
            elif self.execution is not None:
                log.execution(self.execution)
            log.log("info", "a line of somebody")
            log.finish("solved" if self.plan.solved else "unsolved", {"search": 0.1})
        return path


def _closed_loop(plan: Plan) -> Case:
    """Return a closed loop whose objects end with a lateral offset, measured with noise."""
    execution = there(plan.execution)
    rng = np.random.default_rng(3)
    aside = np.linspace(0.0, 0.01, len(execution.t))[:, None, None] * rng.normal(size=3)
    moved = replace(execution, objects=execution.objects + aside, wrenches=rng.normal(size=(len(execution.t), 3)))
    t = execution.t[::7]
    measured = Measured(t, moved.objects[::7] + 1e-3 * rng.normal(size=moved.objects[::7].shape))
    events = (Event(0.0, "plan", "the first"), Event(1.5, "deviation", "an object is away from its pose"))
    replans = (Replan(1.5, plan, "", 0.1), Replan(2.0, None, "nothing found", 0.2))
    return Case(plan, moved, Feedback(measured, events, replans))


def _trial(plan: Plan) -> Case:
    """Return trials of a plan and, in the same log, the execution of one sample with slip."""
    ends: list[TrialEnd] = []
    uncertainty = TrialUncertainty(contact_friction=0.6, load=0.3, position=2e-3)
    trials = execute_trials(plan, 2, uncertainty, seed=3, progress=ends.append)
    assert any(end.contact for end in trials.ends)
    words = {
        "seed": "3",
        "uncertainty": json.dumps(asdict(uncertainty)),
        "simulator": "slip",
        "sample": str(trials.worst),
    }
    return Case(plan, trials.report(trials.worst).execution, trials=tuple(ends), notes={TRIAL: words})


@pytest.fixture(scope="session")
def cases() -> dict[str, Case]:
    plans = {
        name: Planner(scenario_from_text(FAST[name]), time_limit=60.0, iterations=3000, seed=1).plan(first=True)
        for name in ("push", "multi-push", "rearrangement")
    }
    assert all(plan.solved for plan in plans.values()), {name: plan.reason for name, plan in plans.items()}
    found = {name: Case(plan, plan.execution) for name, plan in plans.items()}
    found["closed loop"] = _closed_loop(plans["push"])
    found["trial"] = _trial(plans["push"])
    none = Planner(load_scenario("narrow-gap"), iterations=200, seed=1, time_limit=60.0).plan(first=True)
    without = replace(none, segments=(), execution=None, cost=None, robustness=None, margin=None, margin_asked=None)
    found["no plan"] = Case(replace(without, reason=none.reason or "not found"))
    return found


@pytest.fixture(scope="session")
def logs(cases: dict[str, Case], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("logs")
    return {name: case.write(folder / f"{name}.mcap") for name, case in cases.items()}


Edit = Callable[[Any], Iterator[Any]]
"""Function that takes a record of a log and yields its replacements."""


def rewritten(log: Path, to: Path, edit: Edit) -> Path:
    """Write a log again after `edit` has changed its records, with correct checksums."""
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    with log.open("rb") as source, to.open("wb") as target:
        writer = Writer(target)
        for record in StreamReader(source).records:
            if isinstance(record, records.DataEnd):
                break
            if isinstance(record, records.Header):
                writer.start(record.profile, record.library)
            for one in edit(record):
                if isinstance(one, records.Schema):
                    if one.id not in schemas:
                        schemas[one.id] = writer.register_schema(one.name, one.encoding, one.data)
                elif isinstance(one, records.Channel):
                    if one.id not in channels:
                        channels[one.id] = writer.register_channel(
                            one.topic, one.message_encoding, schemas[one.schema_id], one.metadata
                        )
                elif isinstance(one, records.Message):
                    writer.add_message(
                        channels[one.channel_id], one.log_time, one.data, one.publish_time, one.sequence
                    )
                elif isinstance(one, records.Attachment):
                    writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, one.data)
                elif isinstance(one, records.Metadata):
                    writer.add_metadata(one.name, one.metadata)
        writer.finish()  # type: ignore[no-untyped-call]
    return to


def record_names(log: Path) -> dict[str, list[Any]]:
    """Return the names of messages (by topic), attachments, metadata, schemas and channels."""
    found: dict[str, list[Any]] = {}
    topics: dict[int, str] = {}
    with log.open("rb") as stream:
        for record in StreamReader(stream).records:
            if isinstance(record, records.DataEnd):
                break
            if isinstance(record, records.Schema | records.Channel):
                found.setdefault(type(record).__name__.lower(), []).append(record)
            if isinstance(record, records.Channel):
                topics[record.id] = record.topic
            elif isinstance(record, records.Message):
                found.setdefault(topics[record.channel_id], []).append(record)
            elif isinstance(record, records.Attachment | records.Metadata):
                found.setdefault(record.name, []).append(record)
    return found
