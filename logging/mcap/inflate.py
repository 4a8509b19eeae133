"""Decompression that never yields more than it was told to expect, whatever a frame claims about itself."""

from __future__ import annotations

from collections.abc import Callable

import lz4.frame  # type: ignore[import-untyped]
import zstandard

WINDOW_LIMIT = 8 << 20
"""Largest memory that a zstd frame may demand for its window, bytes."""

_PIECE = 1 << 20
"""What lz4 inflates at a time, bytes: its buffers take several times as much."""


def inflate(data: memoryview, compression: str, size: int) -> memoryview:
    """Return the `size` bytes that `data` holds under `compression` ("", "zstd" or "lz4").

    Raises:
        ValueError: When the compression is unknown, the data are damaged, or they hold fewer or more bytes.
    """
    if compression not in _DECODERS:
        raise ValueError(f"compression {compression!r} is none of '', 'zstd', 'lz4'")
    inflated = _DECODERS[compression](data, size)
    if len(inflated) != size:
        raise ValueError(
            f"a chunk claims {size} bytes and holds {'more' if len(inflated) > size else len(inflated)}"
        )
    return memoryview(inflated)


def _stored(data: memoryview, size: int) -> memoryview:
    return data


def _zstd(data: memoryview, size: int) -> bytes:
    try:
        reader = zstandard.ZstdDecompressor(max_window_size=WINDOW_LIMIT).stream_reader(data)
        return bytes(reader.read(size + 1))
    except zstandard.ZstdError as error:
        raise ValueError(f"damaged zstd data ({error})") from error


def _lz4(data: memoryview, size: int) -> bytearray:
    try:
        decoder = lz4.frame.LZ4FrameDecompressor()
        inflated = bytearray(decoder.decompress(data, max_length=min(_PIECE, size + 1)))
        while not decoder.needs_input and not decoder.eof and len(inflated) <= size:
            inflated += decoder.decompress(b"", max_length=min(_PIECE, size + 1 - len(inflated)))
        return inflated
    except RuntimeError as error:
        raise ValueError(f"damaged lz4 data ({error})") from error


_DECODERS: dict[str, Callable[[memoryview, int], bytes | bytearray | memoryview]] = {
    "": _stored,
    "zstd": _zstd,
    "lz4": _lz4,
}
