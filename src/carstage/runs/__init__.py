"""One run of a configuration: its folder, its processes, its way to committed episodes."""

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
