"""What a picture of the documentation shows, as a hash in the picture itself; a test compares it with the present.

The hash is of the scenario and of what its command comes to (the plan's arcs, the numbers of a stable set, the events
of a closed loop), without times, paths of files and whatever differs from run to run.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PIL import Image
from PIL.PngImagePlugin import PngInfo

KEY = "Content"

_PLANNED = ("solved", "reason", "arcs", "segments")
"""What of a plan's document a picture shows."""
_VOLATILE = ("log", "page", "seconds", "improvements", "progress", "time_of", "worst", "max_force", "height")
"""Parts of keys whose values differ from run to run, or are in no picture."""
_DIGITS = 4


def content_of(scenario: str, document: Mapping[str, Any]) -> str:
    """Return the hash of a scenario's text and of the JSON document of what was made of it."""
    shown = {key: document[key] for key in _PLANNED if key in document} or document
    kept = json.dumps(_kept(shown), sort_keys=True)
    return hashlib.sha256((scenario + kept).encode()).hexdigest()[:16]


def _kept(value: Any) -> Any:
    """Return what stays the same: numbers rounded, without what is volatile."""
    if isinstance(value, Mapping):
        return {
            key: _kept(one)
            for key, one in value.items()
            if not key.endswith("_s") and not any(part in key for part in _VOLATILE)
        }
    if isinstance(value, list):
        return [_kept(one) for one in value]
    return round(value, _DIGITS) + 0.0 if isinstance(value, float) else value


def stamp(picture: Path, content: str) -> None:
    """Write the hash of what it shows into a PNG, and make the file small."""
    words = PngInfo()
    words.add_text(KEY, content)
    with Image.open(picture) as image:
        image.load()
    image.save(picture, pnginfo=words, optimize=True)
