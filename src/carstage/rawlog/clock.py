"""The one rule for the times of a recording: seconds since its first frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def elapsed_s(header: Mapping[str, Any], tick: int, server_time_s: float) -> float:
    """Time of a tick since the first one.

    In synchronous mode it is ``tick / fps``, free of the rounding that the server's clock
    gathers; in asynchronous mode it is what the server's clock says.

    Args:
        header: the raw log's ``episode.json``.
        tick: index of the tick.
        server_time_s: the record's server time (s).
    """
    spec = header["spec"]
    if is_synchronous(header):
        return tick / float(spec["fps"])
    return server_time_s - float(header["first_timestamp_s"])


def is_synchronous(header: Mapping[str, Any]) -> bool:
    """Whether the recorder stepped the server."""
    return bool(header["spec"]["timing"]["mode"] == "sync")
