"""The connection test: can the server of a configuration be used? Nothing is started."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.errors import CarStageError, ConfigError
from carstage.web.messages import ServerCheck
from carstage.web.messages.base import Document

if TYPE_CHECKING:
    from carstage.config import Config

_ANSWER_S = 5.0


class ServerCheckService:
    """Asks a remote server over its protocol, looks for a release's start script, finds clients."""

    def check(self, server: Document) -> ServerCheck:
        """The verdict; never raises for what a user can write."""
        from carstage.config import check_config

        try:
            config = check_config({"server": server})
            return self._check(config)
        except ConfigError as error:
            return ServerCheck(ok=False, message=error.message, hint=error.hint)
        except CarStageError as error:
            return ServerCheck(ok=False, message=error.message, hint=error.hint)

    def _check(self, config: Config) -> ServerCheck:
        from carstage.config.servers import EmbeddedServerConfig, RemoteServerConfig
        from carstage.runs.preflight import check_server
        from carstage.server import find_client

        check_server(config)
        server = config.server
        if isinstance(server, EmbeddedServerConfig):
            from carstage.server import describe_embedded

            described = describe_embedded(carla_version=server.carla_version)
            client = find_client(server.carla_version, server.client_python)
            return ServerCheck(
                ok=True,
                message=f"The embedded simulator speaks CARLA {described.protocol}.",
                version=described.protocol,
                maps=list(described.maps),
                client=f"carla {client.client}",
            )
        if isinstance(server, RemoteServerConfig):
            from carstage.runs.asking import ask_server
            from carstage.server import probe_version

            version = probe_version(server.host, server.port)
            facts = ask_server(server.host, server.port, version, _ANSWER_S)
            client = find_client(version, server.client_python)
            return ServerCheck(
                ok=True,
                message=f"CARLA {version} answers at {server.host}:{server.port}.",
                version=version,
                maps=list(facts.maps),
                client=f"carla {client.client}",
            )
        return ServerCheck(
            ok=True,
            message="The start script is there; the run starts it and finds the client for it.",
        )
