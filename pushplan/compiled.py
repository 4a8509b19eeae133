"""The decorator of all compiled functions: numba with a cache on disk that no change of the sources outlives.

Numba keeps a compiled function for as long as the file it stands in is unchanged, even when a function that it calls,
in another file, has changed. So the first import removes the cache when a source with compiled functions
is not the one that the cache was made from.
"""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from numba import njit

PACKAGE = Path(__file__).parent
STAMP = "sources.sha256"
MARKS = (b"@compiled", b"@lean", b"@woven", b"@intrinsic", b"@overload")
"""What stands above code that ends up in compiled functions."""


def _folders() -> list[Path]:
    """Folders of the package that hold compiled code, and those in them."""
    rooms = _rooms(PACKAGE)
    return [PACKAGE, *rooms, *(inner for room in rooms for inner in _rooms(room))]


def _rooms(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.iterdir()) if path.is_dir() and path.name[0] not in "_."]


def _digest(folders: list[Path]) -> str:
    """Hash of the sources that have compiled functions."""
    digest = hashlib.sha256()
    for folder in folders:
        for source in sorted(folder.glob("*.py")):
            text = source.read_bytes()
            if any(mark in text for mark in MARKS):
                digest.update(hashlib.sha256(text).digest())
    return digest.hexdigest()


def _discard_stale_cache() -> None:
    """Remove compiled code made from other sources; a folder that cannot be written does not change either."""
    folders = _folders()
    stamp = PACKAGE / "__pycache__" / STAMP
    digest = _digest(folders)
    with contextlib.suppress(OSError):
        if stamp.is_file() and stamp.read_text() == digest:
            return
        for folder in folders:
            for index in (folder / "__pycache__").glob("*.nbi"):
                index.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(digest)


_discard_stale_cache()

compiled = njit(cache=True, error_model="numpy")
"""Compile a function on its first call, or load it from the cache; x / 0 is infinite as in NumPy."""

if TYPE_CHECKING:
    lean = compiled
else:
    lean = njit(cache=True, error_model="numpy", _nrt=False)
"""Compile a function that makes no arrays but those of `scratch`: it counts no references to the ones it is given.

Counting takes more than half of the time of short functions that look into tuples of arrays. The option is not part
of numba's documented interface; `compiled` gives the same results, slower.
"""

woven = njit(inline="always", error_model="numpy")
"""Compile a function into its caller instead, for code with one caller.

LLVM optimises a function anew with everything it calls at each level of calls, so every level above a large one costs
compile time.
"""
