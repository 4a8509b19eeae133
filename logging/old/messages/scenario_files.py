"""The scenario of a run as attachments of its log, and back from them alone."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from pushplan.errors import RunLogError, ScenarioError
from pushplan.logging.mcap_file import Attachment, DamageError
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario

if TYPE_CHECKING:
    from pushplan.logging.mcap_file import McapFile

SCENARIO_FILE, SCENARIO_JSON = "scenario.yaml", "scenario.json"
"""The scenario byte for byte, and with everything resolved that it leaves open."""

MEDIA_TYPES = {SCENARIO_FILE: "application/yaml", SCENARIO_JSON: "application/json"}

SCENARIO_FOLDER = "scenario/"
"""Beginning of the names of the files that the scenario refers to, such as pressure maps."""

_MEMORY = 5
"""Bytes of memory for each byte of an attachment: of a pressure map, its numbers as well."""


def attachments_of(scenario: Scenario) -> dict[str, bytes]:
    """Return what a log has to keep so that `ScenarioFiles` gives the scenario back."""
    referred = {SCENARIO_FOLDER + name: data for name, data in scenario.attachments.items()}
    return {SCENARIO_FILE: scenario.source, SCENARIO_JSON: scenario.to_json().encode(), **referred}


class ScenarioFiles:
    """Gathers the attachments that make up the scenario, and reads it from them alone."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._files: dict[str, Attachment] = {}
        self._scenario: Scenario | None = None

    def take(self, attachment: Attachment) -> None:
        """Take the next attachment of the log.

        Raises:
            ValueError: When one of the same name has come before.
        """
        if attachment.name in self._files:
            raise ValueError("a name that was there already")
        if attachment.name in MEDIA_TYPES or attachment.name.startswith(SCENARIO_FOLDER):
            self._file.keep(_MEMORY * len(attachment.data), attachment.offset)
            self._files[attachment.name] = attachment

    def read(self) -> Scenario:
        """Return the scenario.

        The file as the user wrote it counts, unless this version of pushplan fills its gaps differently from the
        version that wrote the log; then the resolved one counts. Of a log to be recovered, either one will do.

        Raises:
            RunLogError: When an attachment is missing or is no scenario.
        """
        if self._scenario is None:
            self._scenario = self._read()
        return self._scenario

    def _read(self) -> Scenario:
        names = [name for name in (SCENARIO_FILE, SCENARIO_JSON) if name in self._files]
        for name in (SCENARIO_FILE, SCENARIO_JSON):
            self._file.require(name in names, f"the attachment {name!r}", vital=not names)
        scenario = self._parsed(names[0])
        if len(names) == 1 or scenario.to_json().encode() == self._files[SCENARIO_JSON].data:
            return scenario
        # The resolved one names no map any more, its source does.
        return replace(self._parsed(SCENARIO_JSON), source=scenario.source, attachments=scenario.attachments)

    def _parsed(self, name: str) -> Scenario:
        text = self._files[name]
        referred = {
            key.removeprefix(SCENARIO_FOLDER): file.data
            for key, file in self._files.items()
            if key.startswith(SCENARIO_FOLDER)
        }
        try:
            return scenario_from_text(text.data, self._file.path / name, referred)
        except ScenarioError as error:
            what = f"the scenario in it is refused: {error}"
            raise RunLogError(str(self._file.path), what, text.offset) from error

    def check(self, words: Mapping[str, str]) -> None:
        """Compare the scenario with what the metadata `pushplan.run` say of it.

        Raises:
            RunLogError: When they mean another one.
        """
        text, expected = self._files.get(SCENARIO_FILE), words.get("scenario_sha256")
        if text and expected and hashlib.sha256(text.data).hexdigest() != expected:
            what = "the scenario is not the one that the metadata name"
            self._file.lose(DamageError(what, text.offset))
