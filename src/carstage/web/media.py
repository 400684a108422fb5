"""Bytes with their media type."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Media:
    """A picture or an array as it is sent.

    Attributes:
        content: the bytes.
        kind: the media type.
    """

    content: bytes
    kind: str
