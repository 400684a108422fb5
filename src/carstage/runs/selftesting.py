"""The self-test of a server that is up: recorded by a collector, judged here."""

from __future__ import annotations

import selectors
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from carstage.config import Config
from carstage.config.servers import ClassServerConfig
from carstage.errors import BadInputError, CarStageError, CollectorError, RawLogError, ServerError
from carstage.execution import CollectorProcess
from carstage.releases import NEWEST, is_newer
from carstage.runs.interruption import GIVE_BACK_S, Interruption
from carstage.runs.preflight import check_server
from carstage.runs.servers import ServerSetup, make_server
from carstage.selftest import Verdict, failed_verdict, plan_self_test
from carstage.server import ClientPython, Endpoint, Server
from carstage.server.asking import ask_server, ask_spawn_points
from carstage.spec import EpisodeSpec

EPISODE_ID = "selftest"
_CALL_TIMEOUT_S = 60.0
"""For a single call: a large map takes a server long to load."""

_SILENCE_S = 300.0
_STOP_S = 20.0


def run_self_test(
    endpoint: Endpoint,
    client: ClientPython,
    folder: Path,
    interruption: Interruption,
    *,
    sensor_warmup_ticks: int | None = None,
    has_ended: Callable[[], bool] = lambda: False,
) -> Verdict:
    """Record the self-test on a server and judge it.

    Nothing of it stays on the server, nor on the disk unless a check fails.

    Args:
        endpoint: the server.
        client: the Python that has the wheel for it.
        folder: an existing folder for plan, log and raw recording, in ``selftest``.
        interruption: the signals.
        sensor_warmup_ticks: as in the collector's plan.
        has_ended: whether the server is one of ours, and gone. The client would wait on for it.

    Returns:
        The verdict; one that says why, when the recording itself fails.

    Raises:
        KeyboardInterrupt: the user asked to end.
    """
    from carstage.selftest import judge_log  # loads what makes labels

    place = folder / EPISODE_ID
    shutil.rmtree(place, ignore_errors=True)  # of an earlier try
    place.mkdir(parents=True)
    try:
        facts = ask_server(endpoint.host, endpoint.port, endpoint.version)
        name, spawn_points = ask_spawn_points(endpoint.host, endpoint.port)
        spec = plan_self_test(facts.dialect, name, spawn_points, facts.blueprints)
        plan = _plan(endpoint, spec, place, sensor_warmup_ticks)
        _record(plan, place, client, endpoint, interruption, has_ended)
        verdict = judge_log(place / "raw")
    except (CollectorError, RawLogError, ServerError) as error:
        verdict = failed_verdict(endpoint.version, client.client, str(error))
    except KeyboardInterrupt:
        shutil.rmtree(place, ignore_errors=True)
        raise
    if verdict.ok:
        shutil.rmtree(place, ignore_errors=True)
    return verdict


def examine_server(config: Config, notify: Callable[[str], None]) -> Verdict:
    """Put the server of a configuration to the self-test, and stop it again if we started it.

    Args:
        config: only its ``server`` section matters.
        notify: called with a sentence on what takes long.

    Raises:
        BadInputError: the server is too old, cannot be, has a collector of its own, or there is no
            client for it.
        ServerError: it does not start or answer.
        KeyboardInterrupt: the user asked to end.
    """
    check_server(config)
    if isinstance(config.server, ClassServerConfig):
        _check_protocol(config.server, make_server(config, None))
    setup = ServerSetup(config)
    with Interruption(notify) as interruption, setup.facts(), TemporaryDirectory() as folder:
        notify("Starting or asking the server, then recording a few frames on it.")
        return run_self_test(
            setup.warm_up(None),
            setup.client,
            Path(folder),
            interruption,
            sensor_warmup_ticks=setup.sensor_warmup_ticks,
            has_ended=lambda: setup.has_ended,
        )


def _check_protocol(asked: ClassServerConfig, server: Server) -> None:
    if server.collector != Server.collector:
        raise BadInputError(
            f"server.name: {asked.name} records with {server.collector}: the self-test asks "
            "CARLA's questions, which such a server does not answer.",
            "Test the class with carstage.testing.server.ServerTests, and look at a short run with "
            "`carstage validate`; see docs/how-to/add-a-simulator.md.",
        )


def describe_verdict(verdict: Verdict) -> Iterator[str]:
    """What the user should read of a verdict, in sentences."""
    if is_newer(verdict.server):
        yield (
            f"CARLA {verdict.server} is newer than {NEWEST}, the newest release that is known "
            f"here: going on with the client {verdict.client}."
        )
    for check in verdict.checks:
        if not check.ok:
            yield f"Self-test of the server: {check.line()}."


def refuse(verdict: Verdict) -> CarStageError:
    """The error for a server that must pass and does not."""
    failed = [check.line() for check in verdict.checks if not check.ok]
    return ServerError(
        "The server fails its self-test:\n" + "\n".join(failed),
        "What is recorded from it may be labelled wrongly. Set server.self_test: on to record it "
        "all the same.",
    )


def _plan(
    endpoint: Endpoint, spec: EpisodeSpec, place: Path, sensor_warmup_ticks: int | None
) -> dict[str, Any]:
    return {
        "plan_version": 1,
        "server": {
            "host": endpoint.host,
            "port": endpoint.port,
            "timeout_s": _CALL_TIMEOUT_S,
            "traffic_manager_port": endpoint.traffic_manager_port,
        },
        "sensor_warmup_ticks": sensor_warmup_ticks,
        "episodes": [
            {
                "episode_id": EPISODE_ID,
                "attempt": "a1",
                "folder": str((place / "raw").absolute()),
                "spec": spec.to_json(),
            }
        ],
    }


def _record(
    plan: dict[str, Any],
    place: Path,
    client: ClientPython,
    endpoint: Endpoint,
    interruption: Interruption,
    has_ended: Callable[[], bool],
) -> None:
    """Run a collector to its end.

    Raises:
        CollectorError: it failed, or said nothing for long, or its server is gone.
        KeyboardInterrupt: the user asked to end.
    """
    collector = CollectorProcess(
        plan,
        plan_path=place / "plan.json",
        log_path=place / "collector.log",
        python=str(client.path),
    )
    reason = ""
    with ExitStack() as stack:
        stack.enter_context(interruption.deferred())
        stack.enter_context(collector)
        stack.enter_context(interruption.kills(collector.kill))
        selector = stack.enter_context(selectors.DefaultSelector())
        selector.register(collector, selectors.EVENT_READ)
        selector.register(interruption, selectors.EVENT_READ)
        deadline_s = time.monotonic() + _SILENCE_S
        while not collector.ended and not interruption.requested:
            if collector in {key.fileobj for key, _ in selector.select(1.0)}:
                deadline_s = time.monotonic() + _SILENCE_S
                for event in collector.read_events():
                    if event["event"] == "error":
                        reason = f"{event.get('message')} {event.get('hint') or ''}".strip()
            if not collector.ended and has_ended():
                collector.kill()
                raise CollectorError("The server ended while it was tested.")
            if time.monotonic() > deadline_s:
                collector.kill()
                raise CollectorError(f"The collector gave no sign for {_SILENCE_S:.0f} s.")
        if interruption.requested:
            own = endpoint.pid is not None  # then there is nothing to give back
            collector.kill() if own else collector.end(GIVE_BACK_S)
        code = collector.wait(_STOP_S)
        tail = collector.log_tail()
    interruption.check()
    if code != 0:
        raise CollectorError(reason or f"The collector ended with exit code {code}: {tail}")
