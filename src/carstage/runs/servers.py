"""Which server a configuration means, what it offers, and starting it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from carstage.config import Config
from carstage.config.drivers import ClassDriver
from carstage.config.explain import error_of
from carstage.config.output import Output
from carstage.config.own_maps import OwnMap, map_sources, own_maps
from carstage.config.scene import OpenScenarioScenario, ScenicScenario
from carstage.config.servers import (
    CarlaServerConfig,
    ClassServerConfig,
    EmbeddedServerConfig,
    RemoteServerConfig,
)
from carstage.config.supervision import Supervision
from carstage.errors import BadInputError, ServerError
from carstage.files.home import without_tilde
from carstage.plan import ServerFacts
from carstage.releases import refusal
from carstage.runs.programs import program_plan
from carstage.server import (
    ANY_PORTS,
    CarlaServer,
    ClientPython,
    EmbeddedServer,
    Endpoint,
    PortRange,
    RemoteServer,
    Server,
    ask_embedded,
    describe_embedded,
    find_client,
    load_server,
)

#: Steps before the first saved one from which sensors are listened to. The embedded simulator's
#: cameras have no exposure that must settle, so drawing through the whole warm-up would be waste.
_EMBEDDED_SENSOR_WARMUP_TICKS = 2


def make_server(config: Config, log_path: Path | None, ports: PortRange = ANY_PORTS) -> Server:
    """The server of a configuration, not started.

    Args:
        config: the configuration.
        log_path: of the server's log.
        ports: where to look for free ones.
    """
    server = config.server
    if isinstance(server, EmbeddedServerConfig):
        maps = (word for _, path in map_sources(config) for word in ("--maps", str(path)))
        grip = () if config.wet_grip else ("--wet-grip", "off")
        return EmbeddedServer(
            port=None if server.port == "auto" else server.port,
            threads=None if server.threads == "auto" else server.threads,
            log_path=log_path,
            arguments=("--protocol", server.carla_version, *grip, *maps),
            traffic_manager_ports=ports,
        )
    if isinstance(server, CarlaServerConfig):
        return CarlaServer(
            without_tilde(server.path),
            port=None if server.port == "auto" else server.port,
            arguments=server.arguments,
            log_path=log_path,
            ports=ports,
        )
    if isinstance(server, ClassServerConfig):
        return load_server(server.name, _absolute(server.folders), server.parameters, log_path)
    return RemoteServer(server.host, server.port)


def _absolute(folders: Iterable[str]) -> list[str]:
    """Folders of the user, each once."""
    return list(dict.fromkeys(str(without_tilde(folder).absolute()) for folder in folders))


def spawn_points_of(name: str, own: OwnMap) -> int:
    """How many spawn points the town has that the embedded simulator makes of a user's map.

    The town is made where the cache does not hold it, which takes a minute for a large one.

    Raises:
        ConfigError: no town can be made of it.
    """
    try:
        answer = ask_embedded("--lanes", name, own_map=own.path)
    except (OSError, ServerError) as error:
        message = f"no town can be made of {own.path}. {error}"
        hint = f"Correct the file; `carstage sim bake --maps {own.path}` tells more."
        raise error_of([(own.field, message, hint)]) from error
    return len(answer["spawn_points"])


def embedded_facts(
    carla_version: str,
    own: Mapping[str, OwnMap] | None = None,
    count: Callable[[str, OwnMap], int] = spawn_points_of,
) -> ServerFacts:
    """What the embedded simulator offers, without starting it.

    Args:
        carla_version: the version of CARLA that it is to speak.
        own: the user's maps that it is to offer, by name.
        count: gives the number of spawn points of such a map.

    Raises:
        ConfigError: a file has the name of a built-in town, or no town can be made of it.
        ServerError: it could not describe itself.
    """
    described, own = describe_embedded(carla_version=carla_version), own or {}
    for name in described.maps.keys() & own.keys():
        message = f"{name} is a built-in town."
        raise error_of([(own[name].field, message, "Give the file another name.")])
    return ServerFacts(
        maps={**described.maps, **{name: count(name, one) for name, one in own.items()}},
        opendrive={name: one.opendrive for name, one in own.items()},
        blueprints={name: blueprint.attributes for name, blueprint in described.blueprints.items()},
        dialect=described.protocol,
        limits=described.limits,
    )


class ServerSetup:
    """A configuration's server: what it offers before the run, and starting it in the run.

    Args:
        config: the configuration.
        make: makes a server that is not started, given the path of its log.
        client: the Python that the collector runs with; None: ``facts`` finds it.
    """

    def __init__(
        self,
        config: Config,
        make: Callable[[Config, Path | None], Server] = make_server,
        client: ClientPython | None = None,
    ) -> None:
        self._config = config
        self._make = make
        self._warm: Server | None = None
        self._remote: RemoteServer | None = None
        self._client = client

    @property
    def supervision(self) -> Supervision:
        """When a server or a collector counts as lost."""
        return self._config.supervision

    @property
    def output(self) -> Output:
        """How raw recordings are written."""
        return self._config.output

    @property
    def driver_folders(self) -> list[str]:
        """Where the collector looks for classes that drive, absolute; none for other drivers."""
        drivers = [driver for _, driver in self._config.located_drivers()]
        return _absolute(
            f for driver in drivers if isinstance(driver, ClassDriver) for f in driver.folders
        )

    @property
    def has_own_collector(self) -> bool:
        """Whether Car-STAGE's collector records from the server."""
        return not isinstance(self._config.server, ClassServerConfig)

    @property
    def collector_folders(self) -> list[str]:
        """Where Python looks for the collector's module last; none where it is Car-STAGE's."""
        server = self._config.server
        return _absolute(server.folders) if isinstance(server, ClassServerConfig) else []

    @property
    def program(self) -> dict[str, Any]:
        """What the collector's plan says of a scenario's program; nothing where there is none."""
        scenario = self._config.scenario
        plays_itself = isinstance(scenario, OpenScenarioScenario) and not scenario.scenario_runner
        if isinstance(scenario, ScenicScenario | OpenScenarioScenario) and not plays_itself:
            return {"program": program_plan(scenario)}
        return {}

    @property
    def raw_must_last(self) -> bool:
        """Whether raw recordings are needed after a crash of the machine.

        Those that are converted at once are not: a broken attempt is recorded again. To bring them
        to the disk would cost it twice what the dataset does.
        """
        return self.output.keep_raw or self._config.conversion.mode == "deferred"

    @property
    def restart_every(self) -> int:
        """Episodes after which the server is replaced; 0: never."""
        server = self._config.server
        return 0 if isinstance(server, RemoteServerConfig) else server.restart_every

    @property
    def sensor_warmup_ticks(self) -> int | None:
        """For the collector's plan: steps before the first saved one with sensors on; None: all."""
        embedded = isinstance(self._config.server, EmbeddedServerConfig)
        return _EMBEDDED_SENSOR_WARMUP_TICKS if embedded else None

    @property
    def exact_sensor_tick(self) -> bool:
        """Whether ``sensor_tick`` counts whole steps, from the first in which somebody listens."""
        return isinstance(self._config.server, EmbeddedServerConfig)

    @property
    def start_notice(self) -> str:
        """What to tell somebody who waits for the server."""
        if isinstance(self._config.server, RemoteServerConfig):
            return "Waiting for the server to answer."
        return "The server is starting; its first start compiles a while."

    @property
    def tested(self) -> bool:
        """Whether the server is tested before the run; one that is not CARLA cannot be."""
        server = self._config.server
        return not isinstance(server, ClassServerConfig) and server.self_test != "off"

    @property
    def must_pass(self) -> bool:
        """Whether a server that fails its self-test is refused."""
        server = self._config.server
        return not isinstance(server, ClassServerConfig) and server.self_test == "require"

    @property
    def client(self) -> ClientPython:
        """The Python that the collector runs with; known inside ``facts``."""
        assert self._client is not None
        return self._client

    @contextmanager
    def facts(self) -> Iterator[ServerFacts]:
        """What the server offers, with the client for it found.

        The embedded simulator describes itself without being started. Another server is started (or
        connected to) for it, and handed to the first ``start``; unused, it is stopped at the end.

        Raises:
            BadInputError: the server is too old, or there is no client for it.
            ServerError: the server does not start or answer.
        """
        server = self._config.server
        try:
            if isinstance(server, EmbeddedServerConfig):
                self._client = self._find_client(server.carla_version)
                facts = embedded_facts(server.carla_version, own_maps(self._config))
            else:
                self._client = self._find_client(self.warm_up(None).version)
                assert self._warm is not None
                facts = self._warm.facts()
            yield facts
        except KeyboardInterrupt:
            if self._warm is not None:
                self._warm.kill()
            raise
        finally:
            if self._warm is not None:
                self._warm.stop()

    def _find_client(self, version: str) -> ClientPython:
        server = self._config.server
        if isinstance(server, ClassServerConfig):
            return ClientPython(Path(sys.executable), version)
        sensors = self._config.sensors_of_all_variants()
        reason = refusal(version, {sensor.kind: sensor.row.since for _, sensor in sensors})
        if reason:
            raise BadInputError(
                f"server: {reason}.", "Use a newer CARLA, or leave such sensors out."
            )
        return find_client(version, server.client_python, create=server.create_client_env)

    def warm_up(self, log_path: Path | None) -> Endpoint:
        """Start the server ahead of the first ``start``, which will then hand it out.

        One that was started so and has ended is replaced.

        Raises:
            BadInputError: the address, the path or the port cannot be.
            ServerError: it ended or did not answer in time.
        """
        if self._warm is not None and self.has_ended:
            self._warm.stop()
            self._warm = None
        if self._warm is None:
            self._warm = self._new(log_path)
            self._warm.start()
        return self._warm.endpoint

    def cool_down(self) -> None:
        """Stop a server that was started ahead: others will take its place."""
        server, self._warm = self._warm, None
        if server is not None:
            server.stop()

    @property
    def has_ended(self) -> bool:
        """Whether the server that was started ahead is one of ours, and gone."""
        return self._remote is None and self._warm is not None and not self._warm.alive()

    def start(self, log_path: Path) -> tuple[Server, Endpoint]:
        """A started server; the caller stops it.

        Raises:
            BadInputError: the address, the path or the port cannot be.
            ServerError: it ended or did not answer in time.
        """
        server, self._warm = self._warm, None
        if server is not None and server.alive():
            return server, server.endpoint
        if server is not None:
            server.stop()
        server = self._new(log_path)
        try:
            return server, server.start()
        except BaseException:
            server.kill()
            raise

    def _new(self, log_path: Path | None) -> Server:
        """A server that is not started; a remote one is the same again."""
        if self._remote is not None:
            return self._remote
        server = self._make(self._config, log_path)
        if isinstance(server, RemoteServer):
            self._remote = server
        return server
