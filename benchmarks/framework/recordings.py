"""Long recordings of one server: their segments are looked at and removed as they are sealed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from carstage.bench.episodes import looping_server
from carstage.rawlog.format import PAYLOAD_SUFFIX, SEALED_SUFFIX
from carstage.server import Endpoint


def server_for(loop: int, running: Endpoint | None) -> AbstractContextManager[Endpoint]:
    """A server that runs already, or one that repeats ``loop`` frames while it is needed."""
    return looping_server(loop) if running is None else nullcontext(running)


def seals_segment(event: Mapping[str, Any]) -> int | None:
    """The segment that is now sealed in every stream, if this event is about that."""
    whole = event["event"] == "segment_sealed" and event["stream"] == "ledger"
    return int(event["segment"]) if whole else None


def drop_segment(raw: Path, index: int, streams: Iterable[str]) -> None:
    """Remove one segment of some streams, so that a long recording fits on any disk."""
    for stream in streams:
        for suffix in (SEALED_SUFFIX, PAYLOAD_SUFFIX):
            (raw / stream / f"{index:06d}{suffix}").unlink(missing_ok=True)
