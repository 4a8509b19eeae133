"""What the messages of a run log say, gathered one after another."""

from __future__ import annotations

from collections.abc import Callable

from pushplan.logging.mcap_file import Message
from pushplan.logging.old.messages import plan_message, schemas
from pushplan.logging.old.messages.effort import Effort
from pushplan.logging.old.messages.execution_message import Collector
from pushplan.logging.old.messages.feedback_message import FeedbackReader
from pushplan.logging.old.messages.recorded import LogLine
from pushplan.logging.old.messages.schemas import MessageClass, Topic
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult, ProgressPoint

TOPICS = (
    schemas.PROGRESS,
    schemas.PLAN,
    schemas.EXECUTION,
    schemas.EXECUTION_END,
    schemas.LOG,
    schemas.MEASURED,
    schemas.EVENTS,
    schemas.REPLANS,
)
"""What is read back; the other topics are for viewers, and follow from these and the scenario."""

_LINE, _BLOCK = 1 << 10, 12 << 10
"""Memory, in bytes, charged for a line beside its text, and at least for a block of samples or an improvement: all
take microseconds to read, so that this bounds the time, too."""


class Contents:
    """Gathers plan, execution and lines from messages; other topics are for viewers.

    Attributes:
        effort: What planning took, once the metadata have told.
        contacts: Returns the number of contacts of the chain.
        plan: The plan, once it has come.
        progress: The improvements so far; their wall-clock times are NaN.
        lines: The lines of /log so far.
        feedback: What a closed loop saw, noticed and planned so far.
        began: Time of the log at which the run began, ns.
    """

    def __init__(self, contacts: Callable[[], int], recover: bool = False) -> None:
        self._recover = recover
        self.effort: Effort | None = None
        self.contacts = contacts
        self.plan: PlanResult | None = None
        self.lines: list[LogLine] = []
        self.progress: list[ProgressPoint] = []
        self.feedback = FeedbackReader()
        self.began = 0
        self._samples: Collector | None = None
        self._execution: Execution | None = None
        self._handlers: dict[str, tuple[Topic, Callable[[MessageClass], None]]] = {
            topic.name: (topic, handler)
            for topic, handler in (
                (schemas.PROGRESS, self._take_progress),
                (schemas.PLAN, self._take_plan),
                (schemas.EXECUTION, self._take_samples),
                (schemas.EXECUTION_END, self._take_end),
                (schemas.LOG, self._take_line),
                (schemas.MEASURED, self.feedback.take_measured),
                (schemas.EVENTS, self.feedback.take_event),
                (schemas.REPLANS, self.feedback.take_replan),
            )
        }

    def take(self, message: Message) -> None:
        """Take the next message.

        Raises:
            ValueError: When it does not fit what came before.
            PushplanError: When its numbers make no plan.
            DecodeError: When it is no message of its type.
        """
        if message.topic not in self._handlers:
            return
        topic, handle = self._handlers[message.topic]
        expected = topic.message.DESCRIPTOR.full_name
        if message.kind != expected:
            raise ValueError(f"it is of type {message.kind!r} instead of {expected}")
        handle(topic.message.FromString(message.data))

    @staticmethod
    def memory(message: Message) -> int:
        """Return the bytes that the message may take once it is decoded."""
        size = len(message.data)
        if message.topic in (schemas.EXECUTION.name, schemas.PROGRESS.name):
            return max(4 * size if message.topic == schemas.PROGRESS.name else size, _BLOCK)
        return 4 * size + _LINE

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """The samples that are missing: the first of each gap and the one behind it."""
        return [] if self._samples is None else self._samples.gaps

    @property
    def cut(self) -> bool:
        """Whether there are samples, but not the end of the execution."""
        return self._samples is not None and self._execution is None

    def execution(self) -> Execution | None:
        """Return the execution as far as it has come, None when none has begun."""
        if self._execution is None and self._samples is not None:
            return self._samples.finish(None)
        return self._execution

    def _take_progress(self, message: MessageClass) -> None:
        self.progress.append(plan_message.decode_progress(message))

    def _take_plan(self, message: MessageClass) -> None:
        if self.plan is not None:
            raise ValueError("there is a plan already")
        if self.effort is None:
            raise ValueError("the metadata 'pushplan.planning' have not come before it")
        self.plan = plan_message.decode(message, self.effort, self.progress)

    def _take_samples(self, message: MessageClass) -> None:
        if self._execution is not None:
            raise ValueError("the execution has ended already")
        if self._samples is None:
            self._samples = Collector(self.contacts(), self._recover)
        self._samples.add(message)

    def _take_end(self, message: MessageClass) -> None:
        if self._execution is not None:
            raise ValueError("the execution has ended already")
        if self._samples is None:
            self._samples = Collector(self.contacts(), self._recover)
        self._execution = self._samples.finish(message)

    def _take_line(self, message: MessageClass) -> None:
        if not 1 <= message.level <= len(schemas.LEVELS):
            raise ValueError(f"level {message.level} is not from 1 to {len(schemas.LEVELS)}")
        time = message.timestamp.seconds + 1e-9 * message.timestamp.nanos - 1e-9 * self.began
        self.lines.append(LogLine(time, schemas.LEVELS[message.level - 1], message.message))
