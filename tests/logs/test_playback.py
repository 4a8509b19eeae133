"""A replay keeps time, in the terminal and for viewers that connect."""

from __future__ import annotations

import base64
import importlib
import io
import json
import struct
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from pushplan.errors import PushplanError
from pushplan.logging.messages import schemas
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.play.live import LiveServer
from pushplan.logging.play.playback import Pace, Playback, ticks
from pushplan.logging.play.terminal import TerminalView, play_in_terminal
from pushplan.logging.reader import read_run


class FakeClock:
    """A clock that passes only while one sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds


@pytest.fixture(scope="module")
def recorded(case: Any, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Return a run read back."""
    return read_run(case.write(tmp_path_factory.mktemp("playback") / "run.mcap"))


def played(play: Playback, end: float, count: int | None = None) -> tuple[list[float], float]:
    """Return the ticks and how long they took."""
    clock = FakeClock()
    found = []
    for tick in ticks(play, end, 0.1, clock, clock.sleep):
        found.append(tick)
        if count is not None and len(found) == count:
            break
    return found, clock.now - 100.0


def test_a_replay_takes_the_time_of_the_run_divided_by_the_rate() -> None:
    for rate in (0.5, 1.0, 4.0):
        found, took = played(Playback(rate=rate), 3.0)
        assert took == pytest.approx(3.0 / rate)
        assert found[0] == 0.0
        assert found[-1] == 3.0
        assert np.diff(found).max() <= 0.1 * rate + 1e-9


def test_a_replay_begins_and_ends_where_it_is_told() -> None:
    found, took = played(Playback(start_offset=1.0, duration=0.5), 3.0)
    assert (found[0], found[-1]) == (1.0, 1.5)
    assert took == pytest.approx(0.5)
    found, _ = played(Playback(start_offset=2.0, duration=99.0), 3.0)
    assert found[-1] == 3.0


def test_a_loop_begins_again() -> None:
    found, took = played(Playback(loop=True), 1.0, count=40)
    assert found.count(1.0) == 3
    assert took == pytest.approx(3.6)


def test_a_late_listener_is_not_waited_for() -> None:
    clock = FakeClock()
    pace = Pace(0.0, 1.0, clock, clock.sleep)
    clock.now += 5.0
    pace.wait_for(2.0)
    assert clock.now == 105.0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rate": 0.0}, "rate is 0.0; it must be finite and > 0"),
        ({"rate": float("nan")}, "rate is nan; it must be finite and > 0"),
        ({"start_offset": -1.0}, "start_offset is -1.0; it must be finite and >= 0"),
        ({"duration": 0.0}, "duration is 0.0; it must be finite and > 0"),
    ],
)
def test_impossible_settings_are_refused(settings: dict[str, float], message: str) -> None:
    with pytest.raises(PushplanError) as caught:
        Playback(**settings)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_beginning_behind_the_end_is_refused() -> None:
    with pytest.raises(PushplanError, match=r"^start_offset is 9\.0 s, but the run ends at 3\.000 s$"):
        played(Playback(start_offset=9.0), 3.0)


# --- in a terminal -----------------------------------------------------------------------------------------------


def test_a_picture_fits_the_terminal_and_moves(recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    view = TerminalView(recorded, recorded.execution, 60, 20)
    first, last = view.picture(0.0), view.picture(float(recorded.execution.t[-1]))
    for picture in (first, last):
        lines = picture.split("\n")
        assert len(lines) <= 20
        assert max(map(len, lines)) <= 60
    assert first != last
    assert "pusher-near" in first
    assert view.picture(0.0) == first


def test_a_run_plays_on_a_terminal_and_gives_the_cursor_back(recorded: RecordedRun) -> None:
    stream = io.StringIO()
    play_in_terminal(recorded, stream, Playback(rate=50.0))
    assert stream.getvalue().startswith("\x1b[?25l")
    assert stream.getvalue().endswith("\x1b[?25h\n")
    assert recorded.execution is not None
    assert f"{recorded.execution.t[-1]:8.2f} / " in stream.getvalue()


# --- for viewers -------------------------------------------------------------------------------------------------


def advertised(channel: dict[str, Any]) -> Any:
    """Return the class of a channel's messages, from nothing but the schema that the server sends."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))


def listen(port: int, found: dict[str, list[tuple[int, bytes]]], until: float) -> None:
    """Subscribe to every topic, as a viewer does, and collect the messages."""
    client = importlib.import_module("websockets.sync.client")
    topics: dict[int, tuple[str, Any]] = {}
    with client.connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"]) as socket:
        while time.monotonic() < until:
            try:
                message = socket.recv(timeout=0.1)
            except TimeoutError:
                continue
            if isinstance(message, str):
                told = json.loads(message)
                for channel in told.get("channels", []) if told["op"] == "advertise" else []:
                    topics[channel["id"]] = channel["topic"], advertised(channel)
                    assert channel["encoding"] == "protobuf"
                    ask = {
                        "op": "subscribe",
                        "subscriptions": [{"id": channel["id"], "channelId": channel["id"]}],
                    }
                    socket.send(json.dumps(ask))
            elif message[0] == 1:
                number, stamp = struct.unpack_from("<IQ", message, 1)
                topic, kind = topics[number]
                kind.FromString(message[13:])
                found.setdefault(topic, []).append((stamp, message[13:]))


def test_a_viewer_that_connects_sees_the_run(recorded: RecordedRun) -> None:
    pytest.importorskip("foxglove")
    pytest.importorskip("websockets")
    found: dict[str, list[tuple[int, bytes]]] = {}
    with LiveServer("test", port=0) as server:
        listener = threading.Thread(target=listen, args=(server.port, found, time.monotonic() + 4.0))
        listener.start()
        time.sleep(0.5)
        server.play(recorded, Playback(rate=3.0, start_offset=0.5))
        server.linger(0.3)
        listener.join()
    assert set(found) == {topic.name for topic in schemas.TOPICS}
    scene = schemas.SCENE.message.FromString(found["/scene"][-1][1])
    assert any(entity.id == "object/far" for entity in scene.entities)
    times = [stamp for stamp, _ in found["/margins"]]
    assert recorded.execution is not None
    assert times[-1] == round(recorded.execution.t[-1] * 1e9)
    assert len(set(times)) > 40


def test_a_viewer_that_comes_late_gets_the_scene(recorded: RecordedRun) -> None:
    pytest.importorskip("foxglove")
    pytest.importorskip("websockets")
    found: dict[str, list[tuple[int, bytes]]] = {}
    with LiveServer("test", port=0) as server:
        server.play(recorded, Playback(rate=100.0))
        listener = threading.Thread(target=listen, args=(server.port, found, time.monotonic() + 1.5))
        listener.start()
        server.linger(1.2)
        listener.join()
    assert {"/scene", "/plan/path", "/tf", "/margins"} <= set(found)


def test_a_port_that_is_taken_is_an_error(recorded: RecordedRun, tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    with LiveServer("first", port=0) as server, pytest.raises(PushplanError, match="cannot listen on"):
        LiveServer("second", port=server.port)
