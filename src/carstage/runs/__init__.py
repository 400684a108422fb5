"""One run of a configuration: its folder, its processes, its way to committed episodes.

What is listed here is imported when it is first used: whoever only reads the folders of runs, as
the graphical interface does, must not wait for all that recording needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.runs.attempts import LeftRun, held_attempts, left_runs
    from carstage.runs.folder import CurrentEpisode, EpisodeCounts, RunStatus
    from carstage.runs.following import record_beside
    from carstage.runs.outcome import RunResult
    from carstage.runs.own_client import recording
    from carstage.runs.pending import pending_recordings
    from carstage.runs.preflight import size_text, work_folder
    from carstage.runs.running import DEFAULT_RETRIES, ConfigSource, run
    from carstage.runs.selftesting import describe_verdict, examine_server

__all__ = [
    "DEFAULT_RETRIES",
    "ConfigSource",
    "CurrentEpisode",
    "EpisodeCounts",
    "LeftRun",
    "RunResult",
    "RunStatus",
    "describe_verdict",
    "examine_server",
    "held_attempts",
    "left_runs",
    "pending_recordings",
    "record_beside",
    "recording",
    "run",
    "size_text",
    "work_folder",
]

__getattr__ = lazy_names(
    __name__,
    {
        "attempts": "LeftRun held_attempts left_runs",
        "following": "record_beside",
        "folder": "CurrentEpisode EpisodeCounts RunStatus",
        "outcome": "RunResult",
        "own_client": "recording",
        "pending": "pending_recordings",
        "preflight": "size_text work_folder",
        "running": "DEFAULT_RETRIES ConfigSource run",
        "selftesting": "describe_verdict examine_server",
    },
)
