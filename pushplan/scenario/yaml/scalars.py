"""What a plain YAML scalar means: the core schema of YAML 1.2.2, section 10.3.2.

PyYAML follows YAML 1.1, where `1e-3` is text and `no` is false.
"""

from __future__ import annotations

import re

Scalar = str | int | float | bool | None

_MOST_DIGITS = 200  # 16^200 still fits a double
_DECIMAL = re.compile(r"[-+]?[0-9]+")
_OCTAL = re.compile(r"0o[0-7]+")
_HEXADECIMAL = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, Scalar] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}


def resolve(text: str) -> Scalar:
    """Return the null, boolean, number or text that an unquoted scalar stands for.

    A number too large for a double becomes infinite, so that whoever asks for a finite number refuses it.
    """
    if text in _WORDS:
        return _WORDS[text]
    for pattern, base in ((_DECIMAL, 10), (_OCTAL, 8), (_HEXADECIMAL, 16)):
        if pattern.fullmatch(text):
            return _integer(text, base)
    return float(text) if _FLOAT.fullmatch(text) else text


def _integer(text: str, base: int) -> int | float:
    if len(text) > _MOST_DIGITS:
        return float("-inf") if text.startswith("-") else float("inf")
    return int(text, base)
