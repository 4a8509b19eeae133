"""A checkout's compiled core: whether it is there, and was made of the sources that are there now."""

from __future__ import annotations

import hashlib
from pathlib import Path

AGAIN = "run `pip install -e .` in the checkout to build it"


def digest_of(folder: Path) -> str:
    """Return the digest of the C++ sources in a folder; the build compiles it in."""
    digest = hashlib.sha256()
    for path in sorted([*folder.glob("*.cpp"), *folder.glob("*.hpp")]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def require_present_core(folder: Path) -> None:
    """Refuse a core that is missing or of other sources: what it would do is not what the sources say.

    Args:
        folder: The sources of the core.

    Raises:
        ImportError: With the command that mends it.
    """
    from pushplan import core  # without what was built, the folder of the sources itself

    built = getattr(core, "SOURCES", None)
    if built is None:
        raise ImportError(f"pushplan's C++ core is not there: {AGAIN}")
    if built != digest_of(folder):
        raise ImportError(f"pushplan's C++ core was built from other sources than those in {folder}: {AGAIN}")
