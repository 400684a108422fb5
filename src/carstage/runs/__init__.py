"""One run of a configuration: its folder, its processes, its way to committed episodes.

What is listed here is imported when it is first used: whoever only reads the folders of runs, as
the graphical interface does, must not wait for all that recording needs.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from carstage.runs.attempts import DeadRun, dead_runs
    from carstage.runs.folder import CurrentEpisode, EpisodeCounts, RunStatus
    from carstage.runs.outcome import RunObserver, RunResult
    from carstage.runs.preflight import size_text
    from carstage.runs.selftesting import describe_verdict, examine_server
    from carstage.runs.session import DEFAULT_RETRIES, run

__all__ = [
    "DEFAULT_RETRIES",
    "CurrentEpisode",
    "DeadRun",
    "EpisodeCounts",
    "RunObserver",
    "RunResult",
    "RunStatus",
    "dead_runs",
    "describe_verdict",
    "examine_server",
    "run",
    "size_text",
]

_MODULES = {
    "DEFAULT_RETRIES": "session",
    "CurrentEpisode": "folder",
    "DeadRun": "attempts",
    "EpisodeCounts": "folder",
    "RunObserver": "outcome",
    "RunResult": "outcome",
    "RunStatus": "folder",
    "dead_runs": "attempts",
    "describe_verdict": "selftesting",
    "examine_server": "selftesting",
    "run": "session",
    "size_text": "preflight",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
