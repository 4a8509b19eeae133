"""Choose runs of a suite by what they are about, or by key."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

from pushplan.bench.suites.suite import RunSpec
from pushplan.errors import PushplanError

FIELDS = ("problem", "planner", "set", "seed")


class SelectionError(PushplanError, ValueError):
    """A filter or a key fits no run."""


def chosen(runs: Sequence[RunSpec], filters: Sequence[str]) -> list[RunSpec]:
    """Return the runs that fit all filters.

    Args:
        runs: To choose from.
        filters: Texts FIELD=PATTERN, where the field is one of `FIELDS`; in the pattern `*` stands for anything.

    Raises:
        SelectionError: When a filter is written wrongly, or no run fits.
    """
    rules = [_rule(text) for text in filters]
    kept = [run for run in runs if all(fnmatchcase(run.words[field], pattern) for field, pattern in rules)]
    if not kept:
        known = {field: sorted({run.words[field] for run in runs}) for field in FIELDS}
        known_text = "; ".join(f"{field}: {', '.join(words[:20])}" for field, words in known.items())
        raise SelectionError(f"no run fits {' and '.join(filters)}; there are {known_text}")
    return kept


def _rule(text: str) -> tuple[str, str]:
    field, sign, pattern = text.partition("=")
    if not sign or field not in FIELDS:
        raise SelectionError(
            f"'{text}' is no filter; allowed: FIELD=PATTERN, FIELD one of {', '.join(FIELDS)}"
        )
    return field, pattern


def with_key(runs: Sequence[RunSpec], key: str) -> RunSpec:
    """Return the run whose key begins so.

    Raises:
        SelectionError: When there is none or several.
    """
    found = [run for run in runs if run.key.startswith(key)]
    if len(found) != 1:
        how = "no run" if not found else f"{len(found)} runs"
        raise SelectionError(
            f"{how} of this suite and version has a key that begins with '{key}'; report.html and runs.csv list the "
            "keys, which are others for every version of pushplan"
        )
    return found[0]
