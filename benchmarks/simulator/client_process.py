"""Runs a trial in a fresh process, because the client wheel keeps state and may abort at exit.

The Traffic Manager and the walkers' navigation live in static objects of the wheel, so a second
try in one process would not start from the same state as the first. The wheel also ends some
processes with ``terminate called without an active exception`` after all work is done; the result
has left by then.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, TypeVar

Result = TypeVar("Result")

_END_TIMEOUT_S = 2.0


class TrialError(RuntimeError):
    """The trial raised, died or ran out of time."""


def run_trial(
    trial: Callable[..., Result], *arguments: Any, timeout_s: float, **options: Any
) -> Result:
    """Calls an importable function in a spawned process and returns its result.

    The process gets an empty home folder, so that the client's navigation cache cannot be stale.

    Raises:
        TrialError: with the trial's traceback, its exit status, or the time it was given.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    with tempfile.TemporaryDirectory(prefix="carstage-check-") as home:
        process = context.Process(
            target=_child, args=(sender, home, trial, arguments, options), daemon=True
        )
        process.start()
        sender.close()
        try:
            if not receiver.poll(timeout_s):
                raise TrialError(f"the trial did not end within {timeout_s:.0f} s")
            succeeded, value = receiver.recv()
        except EOFError:
            process.join(_END_TIMEOUT_S)
            raise TrialError(f"the client process died, exit status {process.exitcode}") from None
        finally:
            process.terminate()
            process.join(_END_TIMEOUT_S)
            if process.is_alive():
                process.kill()
                process.join()
            receiver.close()
    if not succeeded:
        raise TrialError(f"the trial failed:\n{value}")
    result: Result = value
    return result


def _child(
    sender: Connection,
    home: str,
    trial: Callable[..., Any],
    arguments: tuple[Any, ...],
    options: dict[str, Any],
) -> None:
    os.environ["HOME"] = home
    try:
        sender.send((True, trial(*arguments, **options)))
    except Exception:  # noqa: BLE001 - handed to the parent, which raises it
        sender.send((False, traceback.format_exc()))
    sender.close()
