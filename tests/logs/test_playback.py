"""A replay keeps time, in the terminal and for viewers that connect."""

from __future__ import annotations

import base64
import dataclasses
import importlib
import io
import json
import os
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from pushplan.errors import PushplanError
from pushplan.logging.messages import schemas
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.play.live import LiveServer
from pushplan.logging.play.playback import Pace, Playback
from pushplan.logging.play.terminal import TerminalView, play_in_terminal
from pushplan.logging.play.transport import Transport
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
    """Return the times shown and how long that took."""
    clock = FakeClock()
    transport = Transport(play, end, clock)
    found = [transport.now()]
    while not transport.finished and len(found) != count:
        clock.sleep(0.1)
        found.append(transport.now())
    return found, clock.now - 100.0


def test_a_replay_takes_the_time_of_the_run_divided_by_the_rate() -> None:
    for rate in (0.5, 1.0, 4.0):
        found, took = played(Playback(rate=rate), 3.0)
        assert took == pytest.approx(3.0 / rate, abs=0.11)
        assert (found[0], found[-1]) == (0.0, 3.0)
        assert np.diff(found).max() <= 0.1 * rate + 1e-9


def test_a_replay_begins_and_ends_where_it_is_told() -> None:
    found, took = played(Playback(start_offset=1.0, duration=0.5), 3.0)
    assert (found[0], found[-1]) == (1.0, 1.5)
    assert took == pytest.approx(0.5, abs=0.11)
    found, _ = played(Playback(start_offset=2.0, duration=99.0), 3.0)
    assert found[-1] == 3.0


def test_a_loop_begins_again() -> None:
    found, _ = played(Playback(loop=True), 1.0, count=40)
    assert found.count(1.0) == 3
    assert min(found[15:]) < 0.1


def test_keys_steer_a_replay_as_those_of_ros2_bag_play() -> None:
    clock = FakeClock()
    transport = Transport(Playback(), 3.0, clock)
    right, left, up, down = (f"\x1b[{letter}" for letter in "CDAB")
    clock.sleep(1.0)
    transport.press(" ")
    clock.sleep(5.0)
    assert transport.now() == pytest.approx(1.0)
    assert transport.paused
    transport.press(right)
    assert transport.now() == pytest.approx(1.1)
    transport.press(left)
    transport.press(left)
    assert transport.now() == pytest.approx(0.9)
    transport.press(" ")
    for _ in range(2):
        transport.press(up)
    assert transport.rate == pytest.approx(1.21)
    clock.sleep(1.0)
    assert transport.now() == pytest.approx(0.9 + 1.21)
    transport.press(down)
    assert transport.rate == pytest.approx(1.1)
    transport.press("x")
    assert not transport.finished
    transport.press("q")
    assert transport.finished


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


@pytest.mark.parametrize(("columns", "lines"), [(79, 23), (60, 20), (30, 40), (200, 50)])
def test_a_picture_fills_the_terminal_and_moves(columns: int, lines: int, recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    view = TerminalView(recorded, recorded.execution, columns, lines)
    first, last = view.picture(0.0), view.picture(float(recorded.execution.t[-1]))
    for picture in (first, last):
        shown = picture.split("\n")
        assert len(shown) == lines
        assert max(map(len, shown)) == columns
    assert first != last
    assert "pusher-near" in first
    assert view.picture(0.0) == first


def test_bars_stand_beside_the_picture_where_there_is_room(recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    for columns, beside in ((79, True), (40, False)):
        shown = TerminalView(recorded, recorded.execution, columns, 23).picture(0.0).split("\n")
        (line,) = [number for number, text in enumerate(shown) if "pusher-near" in text]
        assert (line < 5) == beside
        assert any("\u2801" <= letter <= "\u28ff" for letter in "".join(shown))


def test_long_names_are_cut_and_the_worst_contacts_shown(recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    chain = recorded.scenario.chain
    long = tuple(dataclasses.replace(one, name=one.name + 60 * "x") for one in chain.objects)
    scenario = dataclasses.replace(recorded.scenario, chain=dataclasses.replace(chain, objects=long))
    run = dataclasses.replace(recorded, scenario=scenario)
    for columns in (79, 40):
        shown = TerminalView(run, recorded.execution, columns, 23).picture(0.0).split("\n")
        assert max(map(len, shown)) <= columns
        assert sum("…" in line and "·" in line for line in shown) == 2


def test_a_run_plays_on_a_terminal_and_gives_the_cursor_back(recorded: RecordedRun) -> None:
    stream = io.StringIO()
    play_in_terminal(recorded, stream, Playback(rate=50.0))
    assert stream.getvalue().startswith("\x1b[?25l")
    assert stream.getvalue().endswith("\x1b[?25h\n")
    assert recorded.execution is not None
    assert f"{recorded.execution.t[-1]:8.2f} / " in stream.getvalue()


def test_another_size_of_the_window_draws_all_anew(
    recorded: RecordedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = iter([os.terminal_size((80, 24)), os.terminal_size((80, 24)), os.terminal_size((120, 30))])
    monkeypatch.setattr("shutil.get_terminal_size", lambda: next(sizes))
    stream, keys = io.StringIO(), iter([" ", "", "q"])
    with pytest.raises(StopIteration):
        play_in_terminal(recorded, stream, Playback(), lambda seconds: next(keys))
    pictures = stream.getvalue().split("\x1b[H")
    assert stream.getvalue().count("\x1b[2J") == 2
    assert [len(picture.split("\n")) for picture in pictures[1:]] == [23, 23, 30]
    assert "paused" in pictures[2]


# --- for viewers -------------------------------------------------------------------------------------------------


def advertised(channel: dict[str, Any]) -> Any:
    """Return the class of a channel's messages, from nothing but the schema that the server sends."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))


class Viewer:
    """Subscribes to every topic, as a viewer does, and collects the messages.

    Attributes:
        found: What came, by topic: times of the log, ns, and messages.
    """

    def __init__(self, port: int) -> None:
        client = importlib.import_module("websockets.sync.client")
        self.found: dict[str, list[tuple[int, bytes]]] = {}
        self._topics: dict[int, tuple[str, Any]] = {}
        self._left, self._port, self._connect = threading.Event(), port, client.connect
        self._thread = threading.Thread(target=self._listen)

    def __enter__(self) -> Viewer:
        self._thread.start()
        return self

    def __exit__(self, *problem: object) -> None:
        self._left.set()
        self._thread.join()

    @property
    def has_subscribed(self) -> bool:
        return len(self._topics) == len(schemas.TOPICS)

    def time_of(self, topic: str) -> int:
        """Return the time of the last message on a topic; -1 as long as there is none."""
        return self.found[topic][-1][0] if topic in self.found else -1

    def _listen(self) -> None:
        with self._connect(f"ws://127.0.0.1:{self._port}", subprotocols=["foxglove.sdk.v1"]) as socket:
            while not self._left.is_set():
                try:
                    message = socket.recv(timeout=0.1)
                except TimeoutError:
                    continue
                if isinstance(message, str):
                    told = json.loads(message)
                    for channel in told.get("channels", []) if told["op"] == "advertise" else []:
                        assert channel["encoding"] == "protobuf"
                        wish = {"id": channel["id"], "channelId": channel["id"]}
                        socket.send(json.dumps({"op": "subscribe", "subscriptions": [wish]}))
                        self._topics[channel["id"]] = channel["topic"], advertised(channel)
                elif message[0] == 1:
                    number, stamp = struct.unpack_from("<IQ", message, 1)
                    topic, kind = self._topics[number]
                    kind.FromString(message[13:])
                    self.found.setdefault(topic, []).append((stamp, message[13:]))


def linger_until(server: LiveServer, condition: Callable[[], bool]) -> None:
    """Let a server stay until something is so."""
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end, "waited in vain for a minute"
        server.linger(0.05)


def test_a_viewer_that_connects_sees_the_run(recorded: RecordedRun) -> None:
    pytest.importorskip("foxglove")
    pytest.importorskip("websockets")
    assert recorded.execution is not None
    last = round(recorded.execution.t[-1] * 1e9)
    with LiveServer("test", port=0) as server, Viewer(server.port) as viewer:
        linger_until(server, lambda: viewer.has_subscribed)
        server.play(recorded, Playback(rate=3.0, start_offset=0.5))
        linger_until(server, lambda: viewer.time_of("/margins") == last)
    found = viewer.found
    assert set(found) == {topic.name for topic in schemas.TOPICS} - {
        "/robot",
        "/segment",
        "/measured",
        "/events",
        "/plan/replans",
        "/pusher/wrench",
    }  # of several pushes, and of closed loops
    scene = schemas.SCENE.message.FromString(found["/scene"][-1][1])
    assert any(entity.id == "object/far" for entity in scene.entities)
    assert len({stamp for stamp, _ in found["/margins"]}) > 40


def test_a_viewer_that_comes_late_gets_the_scene(recorded: RecordedRun) -> None:
    pytest.importorskip("foxglove")
    pytest.importorskip("websockets")
    with LiveServer("test", port=0) as server:
        server.play(recorded, Playback(rate=100.0))
        with Viewer(server.port) as viewer:
            linger_until(server, lambda: {"/scene", "/plan/path", "/tf", "/margins"} <= set(viewer.found))


def test_a_port_that_is_taken_is_an_error(recorded: RecordedRun, tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    with LiveServer("first", port=0) as server, pytest.raises(PushplanError, match="cannot listen on"):
        LiveServer("second", port=server.port)
