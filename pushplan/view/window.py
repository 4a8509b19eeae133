"""The window: a server with handles and buttons, and a new plan after every move."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np

from pushplan.drawing.scene import Scene
from pushplan.plans.run import Run
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.naming import optional
from pushplan.view.answers import Answer, Answers, Worker
from pushplan.view.draft import MOST_DRAGGED, START, Draft

if TYPE_CHECKING:
    from pushplan.view.stage import Stage

LARGEST_MESSAGE = 1 << 16
"""Largest message from a browser, bytes; a dragged pose needs a few hundred."""

_THEME = b"""<script>
window.__VISER_EMBED_CONFIG__ = { darkMode: matchMedia("(prefers-color-scheme: dark)").matches };
</script>"""
"""Sets dark mode from the browser's preference; viser itself has only one setting for all browsers."""


def serve(port: int, label: str) -> Any:
    """Start and return a viser server on this machine that accepts only requests of its own page.

    Raises:
        MissingExtraError: If viser is not installed.
    """
    viser = optional("viser", "the window", "viser", "view")
    from viser import _messages
    from websockets.asyncio import server as sockets

    begin = sockets.serve

    def guarded(*args: Any, process_request: Any, **settings: Any) -> Any:
        settings["max_size"] = LARGEST_MESSAGE
        return begin(*args, process_request=_own_origin_first(process_request), **settings)

    # viser cannot pass settings to its websocket server. It listens when its constructor returns.
    with (
        patch.object(sockets, "serve", guarded),
        redirect_stdout(io.StringIO()),
    ):  # hides its banner, which `verbose` does not control
        server = viser.ViserServer(host="127.0.0.1", port=port, label=label, verbose=False)
    # The window accepts no files, and viser would allocate memory for every announced file.
    for kind in (_messages.FileTransferStartUpload, _messages.FileTransferPart):
        server.gui._websock_interface.unregister_handler(kind)
    return server


def _own_origin_first(respond: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Refuse requests from other origins, and websockets without an origin, before any other processing."""

    def checked(connection: Any, request: Any) -> Any:
        port = connection.local_address[1]
        own = {f"http://127.0.0.1:{port}", f"http://localhost:{port}"}
        origins = request.headers.get_all("Origin")
        websocket = bool(request.headers.get_all("Upgrade"))
        if not own.issuperset(origins) or (websocket and len(origins) != 1):
            return connection.respond(HTTPStatus.FORBIDDEN, "Only the page of this window can connect.\n")
        if not websocket:
            request.headers.pop("Accept-Encoding", None)  # the response is edited below
        response = respond(connection, request)
        if response is not None and response.headers.get("Content-Type", "").startswith("text/html"):
            response.body = response.body.replace(b"<head>", b"<head>" + _THEME, 1)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))
        return response

    return checked


_FRAME = 1.0 / 30.0
"""Time between pictures of an execution, s."""

_DRAWING = 0.1
"""Pause to send and draw an answer before the next work, s. Compiled code holds the interpreter lock, and a browser
without a graphics card draws on the same processors."""
_LOOKS = 15
"""Number of checks, `_REST` apart, that a page uses the camera."""
_PANEL_PIXELS = 350
"""Width of the panel beside the floor, pixels."""
_PANEL = 0.25
"""Upward shift of the picture on a phone, as a share of the camera's distance."""

_REST = 0.2
"""Time without a move after which a plan is improved, s."""


class Window:
    """A scenario in a browser, planned again after every move of its poses.

    Args:
        scenario: Scenario of any kind.
        port: Port of the server, on this machine only; if it is not free, the next free one.
        message: Function that receives messages for the user.

    Attributes:
        draft: Current draft.
        answer: Last answer; None before the first.
        server: Server of viser.
        stage: Drawn contents of the window.

    Raises:
        MissingExtraError: If viser is not installed.
        EmptyStableSetError: If no pusher twist keeps every contact.
    """

    def __init__(self, scenario: Scenario, port: int = 8080, message: Callable[[str], None] | None = None) -> None:
        optional("viser", "the window", "viser", "view")
        from pushplan.view.stage import Stage

        self.draft = Draft.of(scenario)
        self.answer: Answer | None = None
        self._answers = Answers(scenario, message)
        self._number, self._playing = 0, threading.Event()
        self._seen: Scene | None = None
        self.server = serve(port, "pushplan")
        self._look_at_all()
        self.stage: Stage = Stage(self.server.scene, self.draft)
        self._panel()
        self._worker: Worker[tuple[Draft, bool]] = Worker(self._work)
        self._handles()
        self._ask(dropped=True)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://localhost:{self.server.get_port()}"

    def wait(self) -> None:
        """Serve until interrupted, and raise errors of the planning thread."""
        while self._worker.alive:
            time.sleep(0.2)
        if self._worker.failure is not None:
            raise self._worker.failure

    def close(self) -> None:
        """Stop the server."""
        self._playing.clear()
        self._worker.end()
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    def move(self, change: Callable[[Draft], Draft], dropped: bool) -> None:
        """Change the draft and plan it; a dropped draft is also timed and improved."""
        self._playing.clear()
        self.draft = change(self.draft)
        self._ask(dropped)

    def _ask(self, dropped: bool) -> None:
        self._worker.ask((self.draft, dropped))

    def _work(self, question: tuple[Draft, bool], outdated: Callable[[], bool]) -> None:
        draft, dropped = question
        began = time.perf_counter()
        shown = self.answer if self.answer is not None and self.answer.draft is draft else None
        answer = shown or self._answers.ask(draft, "path")  # already known if the mouse rested before the drop
        if answer.stage == "path":
            self._show(answer, began, dropped)
            if not dropped or not self._worker.idle(_DRAWING):
                return
            answer = self._answers.ask(draft, "timed")
            self._show(answer, began, dropped)
        if answer.stage == "timed" and answer.solved and self._worker.idle(_REST):
            better = self._answers.ask(draft, "polished", outdated)
            if better.solved and not outdated() and not self._playing.is_set():
                self._show(better, began, dropped)

    def _show(self, answer: Answer, began: float, dropped: bool) -> None:
        from pushplan.view.panel import answer_html, stable_set_html

        changed = self.answer is None or not np.array_equal(self.answer.draft.slides, answer.draft.slides)
        plan = answer.plan if answer.solved else None
        with self.server.atomic():
            if changed and answer.scenario is not None:
                self.stage.draw_bodies(answer.draft, Scene.of(answer.scenario))
            if changed or (self.answer is not None and self.answer.stable is not answer.stable):
                self._set.content = stable_set_html(answer.stable)
            self._seen = None if plan is None else Scene.of(plan.scenario, plan)
            self.stage.draw_plan(self._seen)
            found = answer.plan
            self.stage.tint(frozenset() if found is None or found.solved else found.blocking)
            self.answer, self._number = answer, self._number + 1
            spent = 1e3 * (time.perf_counter() - began)
            self._said.content = answer_html(answer, self._number, spent, dropped)
            self._play.disabled = plan is None or plan.execution is None
        self.server.flush()  # sends now instead of after 1/60 s

    def _handles(self) -> None:
        draft, stage = self.draft, self.stage
        for key, pose in draft.poses.items():
            standing = key.startswith("obstacle/")
            if not standing or len(draft.original.obstacles) <= MOST_DRAGGED:
                stage.handle(f"/{key}", pose, partial(self._moved, key), arrows=not standing)
        for k in range(len(draft.slides)):
            contact = draft.original.chain.contacts[k]
            along = np.array(
                [*(0.5 * (contact.right + contact.left)), np.arctan2(-contact.tangent[0], contact.tangent[1])]
            )
            stage.handle(f"/{START}/slide{k}", along, partial(self._slid, k, along), (False, True, False))
        stage.draw_obstacles(draft)
        stage.draw_bodies(draft, Scene.of(draft.original))  # after the handles, which are their parents

    def _moved(self, key: str, pose: FloatArray, dropped: bool) -> None:
        self.move(lambda it: it.moved(key, pose), dropped)

    def _slid(self, k: int, along: FloatArray, pose: FloatArray, dropped: bool) -> None:
        tangent = self.draft.original.chain.contacts[k].tangent
        self.move(lambda it: it.slid(k, float((pose - along)[:2] @ tangent)), dropped)

    def _panel(self) -> None:
        from pushplan.view.panel import help_html

        gui = self.server.gui
        gui.add_html(help_html(self.draft))
        self._said = gui.add_html("")
        self._play = gui.add_button("Play", disabled=True, hint="play the plan at full speed")
        self._set = gui.add_html("")
        save = gui.add_button_group("Save", ("YAML", "JSON", "page"))
        save.on_click(lambda event: self._save(event.client, save.value))
        self._play.on_click(lambda _: self._perform())

    def _perform(self) -> None:
        """Play the execution until its end or the next move."""
        seen, began = self._seen, time.perf_counter()
        if seen is None or len(seen.t) == 1 or self._playing.is_set():
            return
        self._playing.set()
        while self._playing.is_set() and (t := time.perf_counter() - began) < seen.t[-1]:
            self.stage.show_played(seen.at(t))
            time.sleep(_FRAME)
        self.stage.show_played(None)
        self._playing.clear()

    def _save(self, client: Any, kind: str) -> None:
        """Send the scenario, or the page of its plan, to the browser as a file, or explain why it cannot."""
        answer = self.answer
        if answer is None or answer.scenario is None or answer.draft is not self.draft:
            client.add_notification("Not saved", "The scenario is not valid, or is still being planned.")
            return
        if kind == "page":
            from pushplan.logging.page import render

            if answer.plan is None:
                client.add_notification("Not saved", "There is no plan to play.")
                return
            text = render(Run(answer.scenario, answer.plan, answer.plan.execution))
        else:
            text = self.draft.to_yaml() if kind == "YAML" else answer.scenario.to_json()
        suffix = "html" if kind == "page" else kind.lower()
        client.send_file_download(f"{answer.scenario.name}.{suffix}", text.encode(), save_immediately=True)

    def _look_at_all(self) -> None:
        window = Scene.of(self.draft.original).window
        x, y = 0.5 * (window.xmin + window.xmax), 0.5 * (window.ymin + window.ymax)
        reach = max(load.chain.reach for load in self.draft.original.loads)
        away = 0.95 * max(float(window.size.max()), 4.0 * reach)
        self.server.initial_camera.position = (x, y - 1e-3 * away, away)  # from above, for dragging in the plane
        self.server.initial_camera.look_at = (x, y, 0.0)

        def fit(client: Any) -> None:  # beside the panel, or above it on phones
            camera, far = client.camera, away
            seen = 2.0 * np.tan(0.5 * camera.fov)  # ratio of the picture's height to the camera's distance
            if camera.aspect < 1.0:
                far = away / camera.aspect
                middle = x, y - _PANEL * far
            else:
                middle = x + 0.5 * _PANEL_PIXELS / camera.image_height * seen * far, y
            camera.position = (middle[0], middle[1] - 1e-3 * far, far)
            camera.look_at = (*middle, 0.0)

        def fit_until_seen(client: Any) -> None:  # a slow page can reset the camera after our first change
            fit(client)
            first = np.array(self.server.initial_camera.position)
            for _ in range(_LOOKS):
                time.sleep(_REST)
                if np.allclose(client.camera.position, first, atol=1e-6):
                    fit(client)

        self.server.on_client_connect(fit_until_seen)
