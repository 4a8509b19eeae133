"""The server of the window, with requests from strangers."""

import tracemalloc
from collections.abc import Iterator
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from conftest import there

pytest.importorskip("viser")
pytest.importorskip("websockets")

from pushplan.view.window import LARGEST_MESSAGE, serve


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    it = serve(0, "test")
    yield it
    it.stop()


def connected(server: Any, origin: str | None) -> Any:
    import viser
    from websockets.sync.client import connect
    from websockets.typing import Origin, Subprotocol

    return connect(
        f"ws://127.0.0.1:{server.get_port()}",
        origin=None if origin is None else Origin(origin.format(port=server.get_port())),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        compression=None,
        max_size=None,
    )


@pytest.mark.parametrize("origin", ["http://127.0.0.1:{port}", "http://localhost:{port}"])
def test_the_own_page_connects(server: Any, origin: str) -> None:
    with connected(server, origin) as socket:
        assert socket.recv(timeout=30.0)


ELSEWHERE = ("http://example.org", "http://example.org:{port}", "http://localhost:{port}.example.org")
"""Names of other hosts, even if they resolve to this one."""


@pytest.mark.parametrize(
    "origin", [None, "null", *ELSEWHERE, "https://localhost:{port}", "http://localhost:1", "http://localhost"]
)
def test_a_foreign_page_does_not_connect(server: Any, origin: str | None) -> None:
    from websockets.exceptions import InvalidStatus

    with pytest.raises(InvalidStatus) as refused, connected(server, origin):
        pass
    assert refused.value.response.status_code == 403


def test_a_page_is_served_to_everyone_but_not_inside_another_page(server: Any) -> None:
    url = f"http://127.0.0.1:{server.get_port()}/"
    with urlopen(url, timeout=30.0) as page:
        assert page.status == 200
    with pytest.raises(HTTPError, match="403"):
        urlopen(Request(url, headers={"Origin": "http://example.org"}), timeout=30.0)


def test_announced_files_take_no_memory(server: Any) -> None:
    import msgspec

    start = {
        "type": "FileTransferStartUpload",
        "source_component_uuid": "a",
        "filename": "b",
        "mime_type": "c",
        "part_count": 4_000_000,
        "size_bytes": 1 << 40,
    }
    with connected(server, "http://localhost:{port}") as socket:
        socket.recv(timeout=30.0)
        tracemalloc.start()
        try:
            for k in range(50):
                socket.send(msgspec.msgpack.encode({**start, "transfer_uuid": str(k)}))
                part = {"type": "FileTransferPart", "source_component_uuid": "a", "transfer_uuid": str(k)}
                socket.send(msgspec.msgpack.encode({**part, "part_index": 0, "content": b"x" * 60_000}))
            socket.ping().wait(30.0)
            assert tracemalloc.get_traced_memory()[0] < 1e6
        finally:
            tracemalloc.stop()
    assert not server.gui._current_file_upload_states


def test_a_large_message_ends_the_connection(server: Any) -> None:
    from websockets.exceptions import ConnectionClosed

    with connected(server, "http://localhost:{port}") as socket:
        socket.send(b"x" * (LARGEST_MESSAGE + 1))
        with pytest.raises(ConnectionClosed) as ended:
            all(iter(lambda: socket.recv(timeout=30.0), None))  # until the connection ends
    assert there(ended.value.rcvd).code == 1009
