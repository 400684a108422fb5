"""``python -m carstage.collector PLAN.json``: the composition root of the collector's process."""

from __future__ import annotations

import argparse
import gc
import logging
import os
import platform
import sys
from typing import List, Optional, Union

from carstage.collector.internals.errors import (
    CollectorError,
    InterruptedByRequestError,
    client_hint,
    writing_failed,
)
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.leaving import leave
from carstage.collector.internals.plan import Plan, read_plan
from carstage.collector.internals.stopping import StopRequest

EXIT_OK = 0
EXIT_FAILED = 1
PLAN_FROM_INPUT = "-"
"""In the plan's place: its path will come, once the server is there."""

_log = logging.getLogger("carstage.collector")


def main(arguments: Optional[List[str]] = None) -> int:
    """Record every episode of a plan; return the exit code.

    0 all recorded; 1 one failed; 2 bad plan; 130 ended by a signal after finishing the frame.
    """
    # What is loaded stays: Python need not look through it for garbage.
    gc.disable()
    options = parse_options(arguments)
    logging.basicConfig(
        stream=sys.stderr, level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s"
    )
    stop = StopRequest()
    stop.on_signals()
    events = EventStream(private_stdout(), stop)
    plan = options.plan
    if plan == PLAN_FROM_INPUT:
        _load_client()
        plan = first_line(sys.stdin.fileno())
        if not plan:
            return EXIT_OK  # nothing is to be recorded after all
    if options.exit_with_input:
        stop.on_closed_input(sys.stdin.fileno())
    code = _run(plan, events, stop)
    events.emit("collector_finished", exit_code=code)
    return code


def parse_options(arguments: Optional[List[str]]) -> argparse.Namespace:
    """The options of the collector."""
    return collector_parser(main.__doc__).parse_args(arguments)


def collector_parser(description: Optional[str]) -> argparse.ArgumentParser:
    """The command line of the collector, and of clients that stand in for it."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "plan",
        help="the plan, JSON; see docs/formats/run-folder.md. -: load the client, then read the "
        "plan's path from the first line of standard input",
    )
    parser.add_argument(
        "--exit-with-input",
        action="store_true",
        help="end cleanly when standard input closes: whoever started this is gone",
    )
    return parser


def first_line(descriptor: int) -> str:
    """The first line of an input, of which nothing behind it is read; empty where it ends."""
    line = bytearray()
    while not line.endswith(b"\n"):
        byte = os.read(descriptor, 1)
        if not byte:
            return ""
        line += byte
    return os.fsdecode(bytes(line[:-1]))


def _load_client() -> None:
    """Import all that recording needs, the client with it; what fails is told with the plan."""
    try:
        from carstage.collector.internals import episode  # noqa: F401
    except ImportError as error:
        _log.info("the client cannot be imported yet: %s", error)


def private_stdout() -> int:
    """A descriptor of standard output for events alone; the client prints there too."""
    sys.stdout.flush()
    private = os.dup(1)
    os.dup2(2, 1)
    return private


def _run(plan_path: str, events: EventStream, stop: StopRequest) -> int:
    try:
        plan = read_plan(plan_path)
        return _record(plan, events, stop)
    except CollectorError as error:
        _report(error, events)
        return error.exit_code
    except RuntimeError as error:
        _log.exception("the client failed")
        _report(error, events)
        return EXIT_FAILED


def _record(plan: Plan, events: EventStream, stop: StopRequest) -> int:
    # Only now: a bad plan is refused even where no carla wheel is installed.
    try:
        from carstage.collector.client import answers, client_version, connect, versions
        from carstage.collector.internals.dialect import check_versions
        from carstage.collector.internals.episode import EpisodeRecorder, Versions
    except ImportError as error:
        raise CollectorError(
            "This Python (%s) has no carla wheel: %s." % (sys.executable, error),
            "Install the wheel of the server's version into it, or use another interpreter.",
        ) from error
    gc.freeze()
    gc.enable()
    events.emit(
        "collector_started",
        pid=os.getpid(),
        client_version=client_version(),
        python=platform.python_version(),
    )
    client = connect(plan.server, stop)
    ends = Versions(*versions(client))
    check_versions(*ends, [episode.spec.dialect for episode in plan.episodes])
    events.emit("connected", server_version=ends.server, map=client.get_world().get_map().name)
    recorder = EpisodeRecorder(client, ends, plan, events, stop)
    code = EXIT_OK
    for episode in plan.episodes:
        try:
            recorded = recorder.record(episode)
        except (CollectorError, RuntimeError, OSError) as error:
            events.emit(
                "episode_aborted",
                episode_id=episode.episode_id,
                attempt=episode.attempt,
                reason=str(error),
            )
            if isinstance(error, InterruptedByRequestError):
                raise
            _log.exception("episode %s, attempt %s", episode.episode_id, episode.attempt)
            _report(error, events)
            code = EXIT_FAILED
            if not answers(client, plan.server.timeout_s):
                _log.error("the server does not answer any more; no further episode is tried")
                break
        else:
            events.emit(
                "episode_recorded",
                episode_id=episode.episode_id,
                attempt=episode.attempt,
                ticks=recorded.ticks,
                incomplete=recorded.incomplete,
            )
    return code


def _report(error: Union[CollectorError, RuntimeError, OSError], events: EventStream) -> None:
    if isinstance(error, OSError):
        error = writing_failed(error)
    if isinstance(error, CollectorError):
        events.emit("error", kind=error.kind, message=error.message, hint=error.hint)
    else:
        events.emit("error", kind="client", message=str(error), hint=client_hint(error))


if __name__ == "__main__":
    leave(main())
