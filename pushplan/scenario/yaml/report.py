"""Findings about a document, collected place by place so that all of them are told at once."""

from __future__ import annotations

from collections.abc import Callable

from pushplan.errors import Finding
from pushplan.scenario.yaml.node import Document, Place, place_text


class Report:
    """Collects what is wrong in one document.

    Attributes:
        document: The document.
        moved: Returns where the file states what stands at a place of the problem at hand.
    """

    def __init__(self, document: Document, moved: Callable[[Place], Place] = lambda place: place) -> None:
        self.document = document
        self._moved = moved
        self._findings: list[Finding] = []

    def add(self, place: Place, what: str, at_key: bool = False) -> None:
        """Note `what` about a place; a place that the text leaves out counts as where it would stand."""
        place = self._moved(place)
        position = self.document.root.locate(place, at_key)
        self._findings.append(Finding(place_text(place), what, *position))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings in the order of the text."""
        return tuple(sorted(dict.fromkeys(self._findings), key=lambda f: (f.line or 0, f.column or 0)))

    def extend(self, findings: tuple[Finding, ...]) -> None:
        """Take over findings that know their place already."""
        self._findings.extend(findings)
