"""Checks that the compiled core of a checkout exists and was built from its current sources."""

from __future__ import annotations

import hashlib
from pathlib import Path

AGAIN = "run `pip install -e .` in the checkout to build it"


def digest_of(folder: Path) -> str:
    """Return the digest of the C++ sources in a folder, which the build compiles into the core."""
    digest = hashlib.sha256()
    for path in sorted([*folder.glob("*.cpp"), *folder.glob("*.hpp")]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def require_present_core(folder: Path) -> None:
    """Check that the core is present and was built from the current sources.

    Args:
        folder: Folder with the sources of the core.

    Raises:
        ImportError: If it is not; the message has the command that builds it.
    """
    from pushplan import core  # if it was not built, this imports the folder of the sources

    built = getattr(core, "SOURCES", None)
    if built is None:
        raise ImportError(f"pushplan's C++ core is missing: {AGAIN}")
    if built != digest_of(folder):
        raise ImportError(f"pushplan's C++ core was built from other sources than those in {folder}: {AGAIN}")
