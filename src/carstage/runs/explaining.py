"""Why an attempt broke off: the server, a signal, the collector's own error, with last words."""

from __future__ import annotations

import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carstage.errors import CarStageError, CollectorError, DiskFullError, ServerError
from carstage.execution import CollectorProcess
from carstage.runs.attempt_commit import AttemptCommit
from carstage.server import Server

_TAIL_LINES = 12


class FinalCollectorError(CollectorError):
    """The collector refused the episode; another attempt would end alike."""


class LostServerError(ServerError):
    """The server runs, but is of no use any more: it hangs, or holds too much memory."""


#: The collector's errors that are more than a broken attempt, by the kind in its event.
_KINDS: dict[str, type[CarStageError]] = {
    "plan": FinalCollectorError,
    "scene": FinalCollectorError,
    "driver": FinalCollectorError,
    "version": FinalCollectorError,
    "disk": DiskFullError,
}


def explain_end(
    attempt_commit: AttemptCommit,
    logs: Path,
    server: Server | None,
    collector: CollectorProcess,
    exit_code: int | None,
    last_words: Mapping[str, Any],
) -> CarStageError:
    """The error of an attempt whose collector ended early.

    Args:
        attempt_commit: the attempt.
        logs: folder of the run's logs.
        server: who served it.
        collector: who recorded it.
        exit_code: the collector's; None when it had to be ended.
        last_words: the fields of the collector's last ``error`` event; empty without one.
    """
    where = _where(attempt_commit)
    if server is not None and not server.alive():
        return ServerError(
            f"The server ended while {where} was recorded{_manner(server.exit_code)}.",
            _with_tail(f"See {logs / 'server.log'}.", server.log_tail()),
        )
    if exit_code is not None and exit_code < 0:
        return CollectorError(
            f"The collector was ended by {signal.Signals(-exit_code).name} in {where}.",
            _with_tail(f"See {logs / 'collector.log'}.", collector.log_tail()),
        )
    if last_words:
        kind = _KINDS.get(str(last_words.get("kind")), CollectorError)
        hint = str(last_words.get("hint") or "")
        if kind is CollectorError and server is not None:
            hint = _with_tail(hint, server.log_tail(), "The server's log ends:")
        return kind(f"{last_words.get('message')} ({where})", hint)
    return CollectorError(
        f"The collector ended with exit code {exit_code} in {where}.",
        _with_tail(f"See {logs / 'collector.log'}.", collector.log_tail()),
    )


def explain_loss(
    attempt_commit: AttemptCommit,
    problem: CarStageError,
    server: Server | None,
    collector: CollectorProcess,
) -> CarStageError:
    """The error of an attempt that was ended for what its watch has seen."""
    message = f"{problem.message} ({_where(attempt_commit)})"
    if isinstance(problem, ServerError):
        tail = "" if server is None else server.log_tail()
        return LostServerError(message, _with_tail(problem.hint, tail))
    return CollectorError(message, _with_tail(problem.hint, collector.log_tail()))


def _where(attempt_commit: AttemptCommit) -> str:
    return f"episode {attempt_commit.job.episode_id}, attempt {attempt_commit.attempt}"


def _manner(exit_code: int | None) -> str:
    """How a process ended, where that is known."""
    if exit_code is None:
        return ""
    if exit_code == -signal.SIGKILL:
        return " (SIGKILL: somebody's, or the system's for lack of memory)"
    return f" ({signal.Signals(-exit_code).name if exit_code < 0 else f'status {exit_code}'})"


def _with_tail(hint: str, tail: str, title: str = "Its log ends:") -> str:
    lines = tail.splitlines()[-_TAIL_LINES:]
    return "\n".join([f"{hint} {title}", *lines]) if lines else hint
