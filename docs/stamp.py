"""The version of pushplan that made a picture, kept in the picture itself; a test compares it."""

from __future__ import annotations

from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

import pushplan

KEY = "Version"


def stamp(picture: Path) -> None:
    """Write the present version into a PNG."""
    words = PngInfo()
    words.add_text(KEY, pushplan.__version__)
    with Image.open(picture) as image:
        image.load()
    image.save(picture, pnginfo=words, optimize=True)
