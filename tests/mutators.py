"""Random defects of files: pieces of text inserted, values inserted, removed or moved."""

import json
from random import Random
from typing import Any

# fmt: off
PIECES = (
    "0", "-1", "1e-3", "1e400", ".nan", "90 deg", "5 mm", "far", "near", "uniform", "unknown", "ecof", "null",
    "[", "]", "{", "}", "[]", "{}", ",", ":", "- ", "\n", "\n  ", "  ", "#", "&a", "*a", "!!x", "<<", "---\n",
    "true", "'", '"', "|", ">", "\t", "\x00", "é", "pose: [0.1, 0, 0]", "offset: 0.3", "[[0, 0], [1, 1], [1, 0]]",
    "[0.9, 1.5]", "[14 deg, 0.5]", "[1.5, 0.9]",
)
VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2.5, 0.0005, 1e9, 1.0, 7, -0.0, 1e308, 10**40, "", "a\nb", "_x", "ä", "\ud800",
    "far", "90 deg", "5 mm", "14 kg", "5 %", "1e99 m", "1e999 m", "\x00", "uniform", "unknown", "ecof", "cof",
    [], {}, [0, 0], [1, 2, 3], [[0, 0], [1, 0], [0, 1]], [[0, 0], [1, 1], [1, 0], [0, 1]], [[]], [[[[[[]]]]]],
    {"box": [1, 1]}, {"feet": [[0, 0]]}, {"feet": [[0, 0], [0, 0, 1]]}, {"pressure_map": "../x"}, ["<word>"],
    {"box": [1, 1], "polygon": [[0, 0], [1, 0], [0, 1]]}, {"car": {"axle": [0, 0, 0]}}, {"circle": 0.1},
    {"circle": 0.1, "center": [0, 0], "pose": [0, 0, 0]}, {"<mapping>": 1}, "x" * 5000, [0] * 5000,
    [0.9, 1.5], ["14 deg", 0.5], [1.5, 0.9], [0.3, 0.3], [0.2, 1e308], [1, None], [0.5, 0.6, 0.7],
)
# fmt: on


def mutated_text(text: str, random: Random) -> str:
    """Return a text with up to four pieces inserted, each in place of up to eight characters."""
    for _ in range(random.randint(1, 4)):
        begin = random.randint(0, len(text))
        end = min(len(text), begin + random.randint(0, 8))
        text = text[:begin] + random.choice(PIECES) + text[end:]
    return text


def mutated_document(document: Any, random: Random) -> Any:
    """Return a document with one to three values replaced, removed, added, repeated or swapped."""
    document = json.loads(json.dumps(document))
    for _ in range(random.choice((1, 1, 2, 3))):
        found = places(document)
        if found:
            _mutate(*random.choice(found), random)
    return document


def places(node: Any) -> list[tuple[Any, Any]]:
    """Return every (container, key) of a document."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    return [place for key, child in items for place in ((node, key), *places(child))]


def _mutate(holder: Any, key: Any, random: Random) -> None:
    kind = random.random()
    if kind < 0.15:
        del holder[key]
    elif kind < 0.25 and isinstance(holder, dict):
        holder[random.choice(("extra", "box", "pose", "of", "widht", "<word>"))] = random.choice(VALUES)
    elif kind < 0.35 and isinstance(holder, list):
        holder.insert(key, holder[key])
    elif kind < 0.45:
        other = random.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
        holder[key], holder[other] = holder[other], holder[key]
    else:
        holder[key] = json.loads(json.dumps(random.choice(VALUES)))
