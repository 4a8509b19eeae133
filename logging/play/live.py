"""A run played to Foxglove and Lichtblick, which connect to this process over a WebSocket."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from threading import Event
from typing import Any

from pushplan.errors import PushplanError
from pushplan.logging.mcap.items import Message
from pushplan.logging.mcap.mcap_file import McapFile
from pushplan.logging.messages import schemas
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.messages.schemas import Topic
from pushplan.logging.play.playback import Pace, Playback
from pushplan.util.extras import optional
from pushplan.util.outputs.partial_file import SUFFIX

PORT = 8765
"""The port that these viewers try by themselves."""

_NANO = 1_000_000_000

_STEP = 0.05
"""Longest time that a newcomer waits, s."""

_BACKLOG = 1 << 14
"""Messages that are kept for a slow viewer."""


class LiveServer:
    """A WebSocket server that plays logs.

    A viewer that comes later gets the last message of every topic at once: scene and plan are sent only once.

    Args:
        name: What viewers show as the source's name.
        host: Address to listen on; the default lets only this machine in.
        port: Port to listen on; 0 takes any that is free.

    Raises:
        MissingExtraError: When foxglove-sdk is not installed.
        PushplanError: When the address or port cannot be had.
    """

    def __init__(self, name: str, host: str = "127.0.0.1", port: int = PORT) -> None:
        foxglove = optional("foxglove", "a live server", "foxglove-sdk", "live")
        websocket = optional("foxglove.websocket", "a live server", "foxglove-sdk", "live")
        self._context = context = foxglove.Context()  # kept: channels close with it
        self._channels = {topic.name: _channel(foxglove, context, topic) for topic in schemas.TOPICS}
        self._last: dict[str, Message] = {}
        self._arrived = Event()
        try:
            self._server = foxglove.start_server(
                name=name, host=host, port=port, context=context,
                server_listener=_listener(websocket, self._arrived),
                capabilities=[foxglove.Capability.Time], message_backlog_size=_BACKLOG,
            )  # fmt: skip
        except (OSError, RuntimeError) as error:
            raise PushplanError(f"cannot listen on {host}:{port}: {error}") from error

    @property
    def port(self) -> int:
        """The port on which the server listens."""
        return int(self._server.port)

    def play(self, run: RecordedRun, play: Playback) -> None:
        """Play a log until its end, or for ever.

        Raises:
            RunLogError: When the file cannot be read any more.
            PushplanError: When the run ends before it would begin.
        """
        execution = run.execution
        begin, stop = play.span(float(execution.t[-1]) if execution is not None and len(execution.t) else 0.0)
        while True:
            pace = Pace(begin, play.rate)
            for message in _messages(run.path):
                time = message.time / _NANO
                if begin <= time <= stop:
                    self._wait(pace, time)
                    self._server.broadcast_time(message.time)
                    self._send(message)
                elif time < begin:
                    self._last[message.topic] = message
                    self._arrived.set()
            if not play.loop:
                return
            self._last.clear()
            self._server.clear_session()

    def _wait(self, pace: Pace, time: float) -> None:
        """Let time pass in short steps, so that newcomers need not wait for the next message."""
        while pace.now < time:
            self._greet()
            pace.wait_for(min(time, pace.now + _STEP * pace.rate))
        self._greet()

    def _greet(self) -> None:
        if self._arrived.is_set():
            self._arrived.clear()
            for message in sorted(self._last.values(), key=lambda message: message.time):
                self._send(message)

    def _send(self, message: Message) -> None:
        self._last[message.topic] = message
        self._channels[message.topic].log(bytes(message.data), log_time=message.time)

    def linger(self, seconds: float) -> None:
        """Stay for viewers that come after the end."""
        pace = Pace(0.0, 1.0)
        self._wait(pace, seconds)

    def stop(self) -> None:
        """End the server."""
        self._server.stop()

    def __enter__(self) -> LiveServer:
        return self

    def __exit__(self, *problem: object) -> None:
        self.stop()


def _listener(websocket: Any, arrived: Event) -> Any:
    """Return what the server tells, from its own thread, that a viewer has subscribed to a topic."""

    class Listener(websocket.ServerListener):  # type: ignore[misc]
        def on_subscribe(self, client: Any, channel: Any) -> None:
            arrived.set()

    return Listener()


def _channel(foxglove: Any, context: Any, topic: Topic) -> Any:
    schema = foxglove.Schema(name=topic.kind, encoding="protobuf", data=topic.schema)
    return foxglove.Channel(topic.name, schema=schema, message_encoding="protobuf", context=context)


def _messages(path: Path) -> Iterator[Message]:
    """Yield the messages of the topics of a run log, as they are."""
    kinds = {topic.name: topic.kind for topic in schemas.TOPICS}
    for item in McapFile(path, recover=path.name.endswith(SUFFIX)).items():
        if isinstance(item, Message) and kinds.get(item.topic) == item.kind:
            yield item
