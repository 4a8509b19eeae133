"""Writes the log of one run, so that a crash at any moment leaves a readable file.

The log grows as NAME.mcap.partial and becomes NAME.mcap when it is finished. Two runs with the same seed write
the same bytes, except in these words of the metadata (as long in both, on one machine with the same versions):

- `pushplan.run`: `started_at`, `machine`, `git`, `crc32`;
- `pushplan.progress.N`: `found_s`, `crc32`;
- `pushplan.planning` and `pushplan.result`: times (`..._s`, `..._at`), `extensions`, `crc32`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log

from pushplan.errors import OutputError
from pushplan.logging.old.execution_writer import ExecutionWriter
from pushplan.logging.old.feedback_writer import FeedbackWriter
from pushplan.logging.old.layout import LAYOUT_FILE, layout_text
from pushplan.logging.old.messages import execution_message, metadata, plan_message, schemas
from pushplan.logging.old.messages.channels import Channels
from pushplan.logging.old.messages.effort import Effort, exact
from pushplan.logging.old.messages.scenario_files import MEDIA_TYPES, attachments_of
from pushplan.logging.old.messages.sentences import execution_sentence, plan_sentence
from pushplan.logging.old.view.contact_messages import contact_messages
from pushplan.logging.old.view.contacts import resting
from pushplan.logging.old.view.frames import frames_at, poses_in_world
from pushplan.logging.old.view.scene import PATH_SPACING, nearest, nothing, scene, tree
from pushplan.logging.old.view.window import smoothed_times
from pushplan.plans.events import Feedback
from pushplan.plans.execution import Execution, inertia_warning
from pushplan.plans.result import PlanResult, ProgressPoint
from pushplan.plans.segment import Segment
from pushplan.scenario.model import Scenario
from pushplan.util.files import Output


class RunLogWriter:
    """A log being written: a context manager that never leaves half a file under the final name.

    Example:
        >>> with RunLogWriter.create("run.mcap", scenario, {"seed": 1}) as log:
        ...     log.plan(plan(scenario, seed=1))
        ...     log.finish("solved")

    Without `finish`, or with an exception inside, the file stays under `partial` and its metadata say why.
    """

    def __init__(self, file: Output, scenario: Scenario, began: int = 0) -> None:
        self._file = file
        self._scenario = scenario
        self._channels = Channels(file, began)
        self._words: dict[str, str] = {}
        self._finished = False
        self._improvements = 0
        self._segments: tuple[Segment, ...] = ()

    @classmethod
    def create(
        cls,
        path: Path | str,
        scenario: Scenario,
        settings: Mapping[str, object],
        words: Mapping[str, str] | None = None,
        new: bool = False,
        began: int = 0,
    ) -> Self:
        """Begin a log: what the run starts from is written when this returns.

        Args:
            path: Final name of the log. A file of that name is replaced when the log is finished, not before.
            scenario: What the run is about.
            settings: Names and values for the metadata `pushplan.run`: planner, set, seed, ...
            words: The metadata `pushplan.run` of a run that is over; None for one that begins now.
            new: Refuse a name that there is already.
            began: Time of the log at which the run begins, ns: it was not the first one in its log.

        Raises:
            OutputError: When the file cannot be written.
        """
        file = Output(path, new=new)
        try:
            log = cls(file, scenario, began)
            log._channels.declare()
            log._begin(metadata.run_words(scenario, settings) if words is None else words)
        except BaseException:
            file.discard()
            raise
        return log

    @property
    def partial(self) -> Path:
        """Name of the file until it is finished."""
        return self._file.partial

    def _begin(self, words: Mapping[str, str]) -> None:
        channels, scenario = self._channels, self._scenario
        channels.note(metadata.RUN, words)
        for name, data in attachments_of(scenario).items():
            channels.attach(name, MEDIA_TYPES.get(name, "application/octet-stream"), data)
        if channels.began:
            channels.send(schemas.SCENE, nothing())  # what the run before has drawn
        channels.send(schemas.SCENE, scene(scenario))
        now = channels.instants(np.zeros(1))
        chain, load = scenario.chain, None if scenario.pushes is None else scenario.start[None]
        rows = {schemas.TF: frames_at(chain, scenario.first_pose[None], load, now)}
        if load is None:
            rows[schemas.CONTACTS] = contact_messages(chain, resting(chain), now)
        channels.send_batch(channels.prepare(rows, now))
        channels.flush()

    def log(self, level: str, text: str) -> None:
        """Write a line to /log.

        Args:
            level: One of `schemas.LEVELS`.
            text: What to say; without wall-clock times, which would differ from run to run.

        Raises:
            ValueError: When the level is none of them.
            OutputError: When the file cannot be written.
        """
        if level not in schemas.LEVELS:
            raise ValueError(f"level {level!r} is none of {', '.join(schemas.LEVELS)}")
        number = schemas.LEVELS.index(level) + 1
        stamp = self._channels.stamp
        line = Log(timestamp=stamp, level=number, message=text, name="pushplan")  # type: ignore[arg-type]
        self._channels.send(schemas.LOG, line)

    def note(self, name: str, words: Mapping[str, str]) -> None:
        """Write metadata under a name that begins with `pushplan.`.

        Raises:
            OutputError: When the file cannot be written.
        """
        self._channels.note(name, words)

    def plan(self, plan: PlanResult) -> None:
        """Write what planning found, and what it took; improvements that `improved` has written are not repeated.

        Raises:
            OutputError: When the file cannot be written.
        """
        channels = self._channels
        effort = Effort.from_plan(plan).to_words()
        channels.note(metadata.PLANNING, effort)
        for point in plan.progress[self._improvements :]:
            self._send_progress(point)
        channels.send_stamped(schemas.COSTS, plan_message.encode_costs(plan.progress))
        self._segments = plan.segments
        channels.send_stamped(schemas.PLAN, plan_message.encode(plan))
        self._show_plan(plan)
        channels.attach(LAYOUT_FILE, "application/json", layout_text(self._scenario, plan))
        self.log("info" if plan.solved else "warning", plan_sentence(plan))
        self._words |= {**effort, **metadata.plan_words(plan)}
        channels.flush()

    def improved(self, point: ProgressPoint) -> None:
        """Write an improvement of the best path; when this returns, no kill can lose it.

        Raises:
            OutputError: When the file cannot be written.
        """
        words = {"found_s": exact(point.seconds), "path_cost": repr(point.cost)}
        self._channels.note(f"{metadata.PROGRESS}.{self._improvements:04d}", words)
        self._send_progress(point)
        self._channels.flush()

    def _send_progress(self, point: ProgressPoint) -> None:
        self._channels.send_stamped(schemas.PROGRESS, plan_message.encode_progress(point))
        self._improvements += 1

    def _show_plan(self, plan: PlanResult) -> None:
        self._channels.send(schemas.PLAN_TREE, tree(plan.tree))
        self._channels.send(schemas.PLAN_NEAREST, nearest(self._scenario.chain, plan))
        if plan.path is not None:
            path = poses_in_world(plan.path.sampled(PATH_SPACING))
            self._channels.send(schemas.PLAN_PATH, path)
        if plan.trajectory is not None:
            times = smoothed_times(plan.trajectory)
            smoothed = poses_in_world(plan.trajectory.poses_at(times))
            self._channels.send(schemas.PLAN_SMOOTHED, smoothed)

    def execution(self, execution: Execution) -> None:
        """Write what the simulator made of the plan, one simulated second after the other.

        Raises:
            OutputError: When the file cannot be written.
        """
        channels = self._channels
        ExecutionWriter(channels, self._scenario.chain, self._segments).write(execution)
        self._end_execution(execution)
        warning = inertia_warning(self._scenario, execution)
        if warning:
            self.log("warning", warning)
        channels.flush()

    def closed_loop(self, execution: Execution, feedback: Feedback) -> None:
        """Write the execution of a closed loop with all that was measured, noticed and planned meanwhile.

        Raises:
            OutputError: When the file cannot be written.
        """
        FeedbackWriter(self._channels, self._scenario.chain, self.log).write(execution, feedback)
        self._end_execution(execution)
        self._channels.flush()

    def _end_execution(self, execution: Execution) -> None:
        self._channels.send_stamped(schemas.EXECUTION_END, execution_message.encode_end(execution))
        self.log("info" if execution.loss is None else "warning", execution_sentence(execution))
        self._words |= metadata.execution_words(execution)

    def finish(self, outcome: str, seconds: Mapping[str, float] | None = None) -> None:
        """End the log and give it its final name.

        Args:
            outcome: How the run ended, in a word: solved, unsolved, ...
            seconds: Wall-clock time of each phase, for the metadata `pushplan.result`.

        Raises:
            OutputError: When the file cannot be written; what is there stays under `partial`.
        """
        self._end(_ended(outcome, seconds))
        self._file.publish()

    def follow(
        self,
        outcome: str,
        scenario: Scenario,
        settings: Mapping[str, object],
        seconds: Mapping[str, float] | None = None,
        words: Mapping[str, str] | None = None,
    ) -> None:
        """End the run, and begin the next one in the same log where its time ends.

        Args:
            outcome: As in `finish`.
            scenario: Of the next run, as the others below; see `create`.
            settings: For the metadata `pushplan.run`.
            seconds: As in `finish`.
            words: The metadata `pushplan.run` of a run that is over.

        Raises:
            OutputError: When the file cannot be written.
        """
        self._conclude(_ended(outcome, seconds))
        self._scenario, self._words, self._improvements, self._segments = scenario, {}, 0, ()
        self._channels.begin_run()
        self._begin(metadata.run_words(scenario, settings) if words is None else words)

    def _conclude(self, words: Mapping[str, str]) -> None:
        self._channels.flush()
        self._channels.note(metadata.RESULT, {**self._words, **words, "finished_at": metadata.now()})

    def _end(self, words: Mapping[str, str]) -> None:
        self._finished = True
        self._conclude(words)
        self._channels.finish()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; see `abandon`."""
        self.abandon(error)

    def abandon(self, error: BaseException | None) -> None:
        """Close the file; if it was not finished, say why in it, as far as that can be written, and leave it."""
        if not self._finished:
            with contextlib.suppress(OutputError):  # nothing more can be written; the first error counts
                self._say_why(error)
        self._file.close()

    def _say_why(self, error: BaseException | None) -> None:
        if error is None:
            self._end({"outcome": "unfinished"})
            return
        outcome = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
        what = f"{type(error).__name__}: {error}"
        self.log("error", f"{outcome}: {what}")
        self._end({"outcome": outcome, "error": what})


def _ended(outcome: str, seconds: Mapping[str, float] | None) -> dict[str, str]:
    """Return how a run ended as metadata."""
    return {"outcome": outcome, **{f"{phase}_s": exact(spent) for phase, spent in (seconds or {}).items()}}
