"""A cache of compiled code on disk that no change of the sources outlives.

Numba keeps a compiled function for as long as the file it stands in is unchanged, even when a function that it calls,
in another file, has changed. So the first import removes the cache when a source with compiled functions
is not the one that the cache was made from.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
STAMP = "sources.sha256"
MARKS = (b"@compiled", b"@in_threads", b"@no_refcount", b"@inlined", b"@inner", b"@intrinsic", b"@overload")
"""What stands above code that ends up in compiled functions."""


def _rooms(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.is_dir() and path.name[0] not in "_.":
            yield path
            yield from _rooms(path)


def digest_of(folders: list[Path]) -> str:
    """Hash of the sources that have compiled functions."""
    digest = hashlib.sha256()
    for folder in folders:
        for source in sorted(folder.glob("*.py")):
            text = source.read_bytes()
            if any(mark in text for mark in MARKS):
                digest.update(hashlib.sha256(text).digest())
    return digest.hexdigest()


def discard_stale_cache() -> None:
    """Remove compiled code made from other sources; a folder that cannot be written does not change either."""
    folders = [PACKAGE, *_rooms(PACKAGE)]
    stamp = PACKAGE / "__pycache__" / STAMP
    digest = digest_of(folders)
    with contextlib.suppress(OSError):
        if stamp.is_file() and stamp.read_text() == digest:
            return
        for folder in folders:
            for index in (folder / "__pycache__").glob("*.nbi"):
                index.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(digest)
