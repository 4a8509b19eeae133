"""The server of the window: a page of another origin cannot steer it, and nothing that it is sent is kept."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stdout
from http import HTTPStatus
from typing import Any
from unittest.mock import patch

from pushplan.util.extras import optional

LARGEST_MESSAGE = 1 << 16
"""What a browser may send at once, bytes; a dragged pose takes some hundred."""

_THEME = b"""<script>
window.__VISER_EMBED_CONFIG__ = { darkMode: matchMedia("(prefers-color-scheme: dark)").matches };
</script>"""
"""Asks the browser, which alone knows, whether the window shall be dark; viser's own setting is one for all."""


def serve(port: int, label: str) -> Any:
    """Start a server of viser on this machine that heeds its own page only, and return it.

    Raises:
        MissingExtraError: When viser is not installed.
    """
    viser = optional("viser", "the window", "viser", "view")
    from viser import _messages
    from websockets.asyncio import server as sockets

    begin = sockets.serve

    def guarded(*args: Any, process_request: Any, **settings: Any) -> Any:
        settings["max_size"] = LARGEST_MESSAGE
        return begin(*args, process_request=_own_origin_first(process_request), **settings)

    # viser hands on no setting of its websocket, and prints a banner. It listens when its constructor returns.
    with (
        patch.object(sockets, "serve", guarded),
        redirect_stdout(io.StringIO()),
    ):  # its banner comes without `verbose`
        server = viser.ViserServer(host="127.0.0.1", port=port, label=label, verbose=False)
    # the window asks for no file, and viser keeps room for every announced one
    for kind in (_messages.FileTransferStartUpload, _messages.FileTransferPart):
        server.gui._websock_interface.unregister_handler(kind)
    return server


def _own_origin_first(respond: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Refuse a request of another origin, and a websocket of none, before anything else is looked at."""

    def checked(connection: Any, request: Any) -> Any:
        port = connection.local_address[1]
        own = {f"http://127.0.0.1:{port}", f"http://localhost:{port}"}
        said = request.headers.get_all("Origin")
        websocket = bool(request.headers.get_all("Upgrade"))
        if not own.issuperset(said) or (websocket and len(said) != 1):
            return connection.respond(HTTPStatus.FORBIDDEN, "Only the page of this window may connect.\n")
        if not websocket:
            request.headers.pop("Accept-Encoding", None)  # what is sent is changed below
        response = respond(connection, request)
        if response is not None and response.headers.get("Content-Type", "").startswith("text/html"):
            response.body = response.body.replace(b"<head>", b"<head>" + _THEME, 1)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))
        return response

    return checked
