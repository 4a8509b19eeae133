"""The checksum that each metadata of ours holds of its own words: MCAP keeps none."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

_CHECKSUM = "crc32"


def sealed(words: Mapping[str, str]) -> dict[str, str]:
    """Return `words` with their checksum."""
    return {**words, _CHECKSUM: _checksum(words)}


def unsealed(words: Mapping[str, str]) -> dict[str, str]:
    """Return `words` without their checksum.

    Raises:
        ValueError: When the checksum is missing or does not fit.
    """
    rest = {key: value for key, value in words.items() if key != _CHECKSUM}
    if words.get(_CHECKSUM) != _checksum(rest):
        raise ValueError("the checksum of the metadata does not fit")
    return rest


def _checksum(words: Mapping[str, str]) -> str:
    text = "".join(f"{len(part)}:{part}" for pair in sorted(words.items()) for part in pair)
    return f"{zlib.crc32(text.encode()):08x}"
