"""Work on the newest question only: what was asked before it is dropped."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Question = TypeVar("Question")


class Worker(Generic[Question]):
    """A thread that answers the question asked last, however fast questions come.

    Args:
        answer: Called in the thread with a question, and with a function that says whether there is a newer one.
    """

    def __init__(self, answer: Callable[[Question, Callable[[], bool]], None]) -> None:
        self._answer = answer
        self._changed = threading.Condition()
        self._waiting: list[Question] = []
        self._ended = False
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._work, daemon=True, name="pushplan-view")
        self._thread.start()

    def ask(self, question: Question) -> None:
        """Put a question in the place of the one that waits."""
        with self._changed:
            self._waiting = [question]
            self._changed.notify()

    def end(self) -> None:
        """Let the thread end after what it is at."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()

    def outdated(self) -> bool:
        """Whether there is a newer question than the one in work."""
        return bool(self._waiting) or self._ended

    def idle(self, seconds: float) -> bool:
        """Let other threads work for a while, and return whether there is no newer question then."""
        with self._changed:
            return not self._changed.wait_for(self.outdated, seconds)

    @property
    def alive(self) -> bool:
        """Whether questions are still answered."""
        return self._thread.is_alive()

    def _work(self) -> None:
        try:
            while (question := self._next()) is not None:
                self._answer(question, self.outdated)
        except BaseException as error:  # told to the user by whoever waits
            self.failure = error

    def _next(self) -> Question | None:
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._ended)
            return None if self._ended else self._waiting.pop()
