"""What the YAML parser stumbles over, in words for people who do not know its grammar."""

from __future__ import annotations

import yaml

from pushplan.scenario.yaml.text import DocumentError, Position, failure

_HINTS = (
    ("found character '\\t'", "a tab cannot stand here; indent with spaces"),
    (
        "mapping values are not allowed",
        "a ':' cannot stand here; indent the line like its neighbours, or quote the text",
    ),
    ("could not find expected ':'", "a key without ':' and value"),
    (
        "expected <block end>, but found",
        "the line is not indented like its neighbours, or a bracket is left over",
    ),
    ("expected ',' or ']'", "a list in [...] lacks a ',' or its ']'"),
    ("expected ',' or '}'", "a mapping in {...} lacks a ',' or its '}'"),
    ("unexpected end of stream", "a quoted text lacks its closing quote"),
    ("unexpected document separator", "a quoted text lacks its closing quote"),
    ("unknown escape character", "an unknown escape in a double-quoted text; write \\\\ for a backslash"),
    ("expected the node content", "a value is missing here"),
    ("incompatible YAML document", "the file claims another YAML version; leave the %YAML line out"),
    ("expected '<document start>'", "something follows the end of the document; a file must hold one"),
)


def explain(error: Exception, reached: yaml.Mark) -> DocumentError:
    """Return the located error for what the parser raised after it had read as far as `reached`.

    Besides its own errors it lets those of Python's conversions out, as on an escape beyond Unicode's end.
    """
    mark, problem = reached, "a number or an escape is out of range"
    if isinstance(error, yaml.MarkedYAMLError):
        mark = error.problem_mark or error.context_mark or reached
        problem = error.problem or str(error)
    position = Position(mark.line + 1, mark.column + 1)
    hint = next((hint for sign, hint in _HINTS if sign in problem), problem)
    return failure(f"not valid YAML: {hint}", position)
