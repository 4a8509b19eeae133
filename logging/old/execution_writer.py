"""Writes what a simulator made of a plan, second by second."""

from __future__ import annotations

import numpy as np

from pushplan.logging.old.messages import execution_message, plan_message, schemas
from pushplan.logging.old.messages.channels import Channels
from pushplan.logging.old.view import views
from pushplan.mechanics.chain import Chain
from pushplan.plans.execution import Execution
from pushplan.plans.segment import Segment
from pushplan.util.arrays import IntArray

_STRETCH = 60
"""Simulated seconds whose messages are made at once: few calls for a short run, little memory for a long one."""


class ExecutionWriter:
    """Samples of an execution on their way into a log.

    Args:
        channels: Of the log.
        chain: What is pushed.
        segments: Of the plan; each is sent when it begins.
    """

    def __init__(self, channels: Channels, chain: Chain, segments: tuple[Segment, ...]) -> None:
        self._channels = channels
        self._chain = chain
        self._segments = segments

    def write(self, execution: Execution) -> None:
        """Write all samples, one simulated second after the other.

        Raises:
            OutputError: When the file cannot be written.
        """
        instants = self._channels.instants(execution.t)
        seconds = list(execution_message.seconds(execution.t))
        for k in range(0, len(seconds), _STRETCH):
            self._samples(execution, instants, seconds[k : k + _STRETCH])

    def _samples(self, execution: Execution, instants: IntArray, seconds: list[slice]) -> None:
        """Write the samples of some `seconds` and flush after each; `instants` (m,), ns, are those of all samples."""
        channels, begin, end = self._channels, seconds[0].start, seconds[-1].stop
        shown = views.viewed(execution)
        shown = shown[(shown >= begin) & (shown < end)]
        messages = views.messages(self._chain, execution, shown, instants[shown])
        batch = channels.prepare(messages, instants[shown])
        for second in seconds:
            channels.send_batch(batch, *np.searchsorted(shown, [second.start, second.stop]))
            channels.advance(int(instants[second.stop - 1]))
            channels.send_stamped(schemas.EXECUTION, execution_message.encode_block(execution, second))
            self._send_segments(float(execution.t[second.stop - 1]))
            channels.flush()

    def _send_segments(self, until: float) -> None:
        """Write the segments that have begun; the time stamp inside is when."""
        while self._segments and self._segments[0].t0 <= until:
            segment, *rest = self._segments
            self._segments = tuple(rest)
            message = plan_message.segment_message(segment)
            message.timestamp.FromNanoseconds(self._channels.began + round(1e9 * segment.t0))
            self._channels.send(schemas.SEGMENT, message)
