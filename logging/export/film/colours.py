"""Pictures in the colours that video is encoded in: brightness for each pixel, colour for each block of four.

ITU-R BT.601 with values from 16 to 235, which players take for granted where a file says nothing else.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pushplan.logging.export.film.frames import Patch

_RED, _GREEN, _BLUE = 0.299, 0.587, 0.114
_BRIGHT, _COLOUR = 219.0 / 255.0, 224.0 / 255.0
_MATRIX = (
    *(_BRIGHT * _RED, _BRIGHT * _GREEN, _BRIGHT * _BLUE, 16.0),
    *(-0.5 * _COLOUR * _RED / (1.0 - _BLUE), -0.5 * _COLOUR * _GREEN / (1.0 - _BLUE), 0.5 * _COLOUR, 128.0),
    *(0.5 * _COLOUR, -0.5 * _COLOUR * _GREEN / (1.0 - _RED), -0.5 * _COLOUR * _BLUE / (1.0 - _RED), 128.0),
)


class FilmColours:
    """The picture that is shown, kept in the colours of video: only what moves is converted and copied."""

    def __init__(self, still: Image.Image) -> None:
        """Begin with a picture of even size."""
        width, height = still.size
        self._shown = _empty(width, height)
        self._still = _empty(width, height)
        self._planes, self._still_planes = (_planes(a, width, height) for a in (self._shown, self._still))
        _write(self._still_planes, Patch(0, 0, still))
        self._shown[:] = self._still
        self._moved: list[Patch] = []

    def with_parts(self, parts: Iterable[Patch]) -> NDArray[np.uint8]:
        """Return the still picture with other parts, (3 h / 2, w): three planes, yuv420p; valid until the next."""
        for part in self._moved:
            for plane, still, where in zip(self._planes, self._still_planes, _places(part), strict=True):
                plane[where] = still[where]
        self._moved = list(parts)
        for part in self._moved:
            _write(self._planes, part)
        return self._shown


def _empty(width: int, height: int) -> NDArray[np.uint8]:
    return np.zeros((height * 3 // 2, width), dtype=np.uint8)


def _planes(picture: NDArray[np.uint8], width: int, height: int) -> list[NDArray[np.uint8]]:
    """Return views of the brightness (h, w) and the two colours (h / 2, w / 2)."""
    colours = picture[height:].reshape(2, height // 2, width // 2)
    return [picture[:height], colours[0], colours[1]]


def _places(part: Patch) -> list[tuple[slice, slice]]:
    """Return where a part is in each plane."""
    width, height = part.image.size
    bright = slice(part.y, part.y + height), slice(part.x, part.x + width)
    colour = slice(part.y // 2, (part.y + height) // 2), slice(part.x // 2, (part.x + width) // 2)
    return [bright, colour, colour]


def _write(planes: list[NDArray[np.uint8]], part: Patch) -> None:
    bright, *colours = part.image.convert("RGB", _MATRIX).split()
    images = [bright, *(colour.reduce(2) for colour in colours)]
    for plane, image, where in zip(planes, images, _places(part), strict=True):
        plane[where] = np.asarray(image)
