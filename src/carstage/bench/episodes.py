"""Episodes of measurements: planned like a user's, made by a client process."""

from __future__ import annotations

import selectors
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from carstage.config import Config, check_config
from carstage.errors import CollectorError
from carstage.execution import CollectorProcess
from carstage.plan import plan_episodes
from carstage.runs.servers import ServerSetup
from carstage.server import EmbeddedServer, Endpoint, allot_ports, free_port
from carstage.spec import EpisodeSpec
from carstage.spec.defaults import QUEUE_BYTES

Progress = Callable[[int, int], None]
"""Called with how much is done, of how much."""

SILENCE_S = 600.0
"""A client without an event for so long hangs; the first pictures of a machine compile kernels."""
_SENSOR_WARMUP_TICKS = 3
_TIMEOUT_S = 60.0


def camera(name: str, kind: str = "rgb", **attributes: Any) -> dict[str, Any]:
    """A camera over the windscreen, as a configuration has it."""
    pose = {"x": 1.5, "z": 1.6}
    return {"id": name, "kind": kind, "pose": pose, "attributes": attributes}


def roof_sensor(name: str, kind: str, **attributes: Any) -> dict[str, Any]:
    """Another sensor, on the roof."""
    return {"id": name, "kind": kind, "pose": {"z": 1.9}, "attributes": attributes}


@contextmanager
def looping_server(loop: int, arguments: Sequence[str] = ()) -> Iterator[Endpoint]:
    """A simulator whose sensors render ``loop`` frames and then repeat them.

    Its streaming port follows its RPC port.

    Args:
        loop: how many distinct frames there are.
        arguments: further ones of the simulator.
    """
    with EmbeddedServer(
        port=allot_ports().rpc, arguments=("--loop", str(loop), *arguments)
    ) as server:
        yield server.endpoint


def planned_episode(document: Mapping[str, Any]) -> EpisodeSpec:
    """The only episode of a configuration for the embedded simulator, without labels."""
    return planned_episode_of(check_config({"labels": {"cameras": []}, **document}))


def planned_episode_of(config: Config) -> EpisodeSpec:
    """The only episode of a checked configuration for the embedded simulator."""
    with ServerSetup(config).facts() as facts:
        (spec,) = plan_episodes(config, facts)
    return spec


def client_plan(
    spec: EpisodeSpec,
    endpoint: Endpoint,
    folder: Path,
    *,
    sensor_warmup_ticks: int | None = _SENSOR_WARMUP_TICKS,
) -> dict[str, Any]:
    """The plan for one client: one episode, recorded into ``folder``.

    Args:
        sensor_warmup_ticks: steps of the warm-up with sensors on; None: all.
    """
    warm = {} if sensor_warmup_ticks is None else {"sensor_warmup_ticks": sensor_warmup_ticks}
    return {
        "plan_version": 1,
        "server": {
            "host": endpoint.host,
            "port": endpoint.port,
            "timeout_s": _TIMEOUT_S,
            "traffic_manager_port": free_port(),
        },
        "queue_bytes": QUEUE_BYTES,
        **warm,
        "episodes": [
            {
                "episode_id": spec.episode_id,
                "attempt": "a1",
                "folder": str(folder),
                "spec": spec.to_json(),
            }
        ],
    }


def record_episode(spec: EpisodeSpec, endpoint: Endpoint, folder: Path) -> None:
    """Let the collector record one episode into ``folder/raw``.

    Raises:
        CollectorError: it failed; see ``events_of``.
    """
    client = CollectorProcess(
        client_plan(spec, endpoint, folder / "raw"),
        plan_path=folder / "plan.json",
        log_path=folder / "collector.log",
    )
    with client:
        for _ in events_of(client):
            pass


def events_of(client: CollectorProcess) -> Iterator[dict[str, Any]]:
    """The events of a client until it ends.

    Raises:
        CollectorError: it reports an error, ends badly, or is silent for long.
    """
    recorded = False
    with selectors.DefaultSelector() as selector:
        selector.register(client, selectors.EVENT_READ)
        while not client.ended:
            if not selector.select(SILENCE_S):
                raise CollectorError(
                    f"The client sent no event for {SILENCE_S:.0f} s.", client.log_tail()
                )
            for event in client.read_events():
                if event["event"] == "error":
                    raise CollectorError(f"The client failed: {event['message']}")
                recorded = recorded or event["event"] == "episode_recorded"
                yield event
    if not recorded:
        raise CollectorError("The client ended before its episode.", client.log_tail())
