"""The one rule for the times of a recording: seconds since its first frame."""

from __future__ import annotations

from carstage.spec import EpisodeSpec


def elapsed_s(
    spec: EpisodeSpec, first_timestamp_s: float, tick: int, server_time_s: float
) -> float:
    """Time of a tick since the first one.

    In synchronous mode it is ``tick / fps``, free of the rounding that the server's clock
    gathers; in asynchronous mode it is what the server's clock says.

    Args:
        spec: the episode's.
        first_timestamp_s: server time of its first tick (s).
        tick: index of the tick.
        server_time_s: the record's server time (s).
    """
    if spec.timing.synchronous:
        return tick / spec.fps
    return server_time_s - first_timestamp_s
