"""Writes what happened in a closed loop, in the order of time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from operator import itemgetter

import numpy as np

from pushplan.logging.old.messages import execution_message, feedback_message, schemas
from pushplan.logging.old.messages.channels import Channels
from pushplan.logging.old.view import views
from pushplan.logging.old.view.frames import poses_in_world
from pushplan.logging.old.view.scene import PATH_SPACING
from pushplan.logging.old.view.window import smoothed_times
from pushplan.mechanics.chain import Chain
from pushplan.plans.events import WARNINGS, Event, Feedback, Replan
from pushplan.plans.execution import Execution
from pushplan.util.arrays import FloatArray

Entry = tuple[int, Callable[[], None]]
"""When to write something, ns, and what writes it."""


class FeedbackWriter:
    """Writes the execution of a closed loop, with all that was measured, noticed and planned meanwhile.

    Args:
        channels: Of the log.
        chain: What is pushed.
        log: Writes a line: level and text.
    """

    def __init__(self, channels: Channels, chain: Chain, log: Callable[[str, str], None]) -> None:
        self._channels, self._chain, self._log = channels, chain, log

    def write(self, execution: Execution, feedback: Feedback) -> None:
        """Write everything but the end of the execution.

        Raises:
            OutputError: When the file cannot be written.
        """
        instants = self._channels.instants(execution.t)
        blocks = [
            (int(instants[second.stop - 1]), partial(self._block, execution, second))
            for second in execution_message.seconds(execution.t)
        ]
        entries: list[Entry] = [*self._shown(execution), *self._feedback(feedback), *blocks]
        for instant, write in sorted(entries, key=itemgetter(0)):  # of the same instant, in this order
            self._channels.advance(instant)
            write()

    def _shown(self, execution: Execution) -> Iterator[Entry]:
        """Yield what viewers see of the execution."""
        shown = views.viewed(execution)
        instants = self._channels.instants(execution.t)[shown]
        batch = self._channels.prepare(views.messages(self._chain, execution, shown, instants), instants)
        for i, instant in enumerate(instants):
            yield int(instant), partial(self._channels.send_batch, batch, i, i + 1)

    def _feedback(self, feedback: Feedback) -> Iterator[Entry]:
        measured = feedback.measured
        for instant, poses in zip(self._channels.instants(measured.t), measured.poses, strict=True):
            yield int(instant), partial(self._measured, poses)
        for event in feedback.events:
            yield self._instant(event.time), partial(self._event, event)
        for replan in feedback.replans:
            yield self._instant(replan.time), partial(self._replan, replan)

    def _instant(self, time: float) -> int:
        return int(self._channels.instants(np.array([time]))[0])

    def _measured(self, poses: FloatArray) -> None:
        self._channels.send(schemas.MEASURED, poses_in_world(poses, self._channels.stamp))

    def _event(self, event: Event) -> None:
        self._channels.send_stamped(schemas.EVENTS, feedback_message.encode_event(event))
        self._log("warning" if event.kind in WARNINGS else "info", f"{event.kind}: {event.text}")

    def _replan(self, replan: Replan) -> None:
        """Write a plan; viewers show it from then on."""
        self._channels.send_stamped(schemas.REPLANS, feedback_message.encode_replan(replan))
        plan = replan.result
        if plan is None or plan.path is None or plan.trajectory is None:
            return
        smoothed = plan.trajectory.poses_at(smoothed_times(plan.trajectory))
        stamp = self._channels.stamp
        self._channels.send(schemas.PLAN_PATH, poses_in_world(plan.path.sampled(PATH_SPACING), stamp))
        self._channels.send(schemas.PLAN_SMOOTHED, poses_in_world(smoothed, stamp))

    def _block(self, execution: Execution, second: slice) -> None:
        """Write the samples of a simulated second, and flush."""
        self._channels.send_stamped(schemas.EXECUTION, execution_message.encode_block(execution, second))
        self._channels.flush()
