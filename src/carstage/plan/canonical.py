"""Ids of many episodes that have most of their specification in common."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields
from typing import Any

from carstage.spec import EpisodeSpec
from carstage.spec.plain import is_left_out, plain

_FIELDS = sorted(fields(EpisodeSpec), key=lambda field: field.name)
_ID_DIGITS = 16
_encode = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
).encode


class CanonicalTexts:
    """Writes canonical JSON; the text of a section that comes again is not written again.

    ``EpisodeSpec.canonical_json`` says what it is; this gives the same bytes for less time.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[Any, str]] = {}

    def canonical_json(self, spec: EpisodeSpec) -> bytes:
        """The canonical JSON of a specification."""
        entries = [
            self._entry(field.name, spec, value)
            for field in _FIELDS
            if not is_left_out(field, value := getattr(spec, field.name))
        ]
        return ("{" + ",".join(entries) + "}").encode()

    def episode_id(self, spec: EpisodeSpec) -> str:
        """The id of a specification."""
        return hashlib.sha256(self.canonical_json(spec)).hexdigest()[:_ID_DIGITS]

    def _entry(self, name: str, spec: EpisodeSpec, value: Any) -> str:
        """The text of a section with its key."""
        last = self._last.get(name)
        if last is not None and last[0] is value:  # kept, so no other can have its identity
            return last[1]
        text = _encode(spec.scenario.to_json() if name == "scenario" else plain(value))
        entry = f'"{name}":{text}'
        self._last[name] = (value, entry)
        return entry
