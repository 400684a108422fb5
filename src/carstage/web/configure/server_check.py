"""The connection test: can the server of a configuration be used? Nothing is started."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from carstage.errors import CarStageError
from carstage.web.messages import ServerCheck
from carstage.web.messages.base import Document
from carstage.web.wording import page_words

if TYPE_CHECKING:
    from carstage.config import Config

_ANSWER_S = 5.0
_VEHICLES = "vehicle."
_MOST_FOLDERS = 2000


def release_folders() -> list[str]:
    """Folders of CARLA releases on this machine, where people put them: the page chooses from them.

    They are looked for in the home folder, in ``/opt`` and ``/srv``, one folder deep, and in
    ``CARLA_ROOT``.
    """
    from carstage.cache import home_folder
    from carstage.server.release import SCRIPT

    named = os.environ.get("CARLA_ROOT")
    places = [home_folder(), Path("/opt"), Path("/srv")]
    looked = [Path(named)] if named else []
    for place in places:
        looked.append(place)
        looked += _below(place)
    found = (folder for folder in looked[:_MOST_FOLDERS] if (folder / SCRIPT).is_file())
    return sorted({str(folder) for folder in found})


def _below(place: Path) -> list[Path]:
    try:
        return sorted(path for path in place.iterdir() if path.is_dir() and path.name[0] != ".")
    except OSError:
        return []  # not there, or not ours to read


class ServerCheckService:
    """Asks a remote server over its protocol, looks for a release's start script, finds clients."""

    def check(self, server: Document) -> ServerCheck:
        """The verdict; never raises for what a user can write."""
        from carstage.config import check_config

        try:
            config = check_config({"server": server})
            return self._check(config)
        except CarStageError as error:
            hint = page_words(error.hint, hint=True)
            return ServerCheck(ok=False, message=page_words(error.message), hint=hint)

    def _check(self, config: Config) -> ServerCheck:
        from carstage.config.servers import EmbeddedServerConfig, RemoteServerConfig
        from carstage.runs.preflight import check_server
        from carstage.server import find_client
        from carstage.web.configure.checking import refuse_foreign_code

        refuse_foreign_code(config.server)
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
            from carstage.server import probe_version
            from carstage.server.asking import ask_server

            version = probe_version(server.host, server.port)
            facts = ask_server(server.host, server.port, version, _ANSWER_S)
            client = find_client(version, server.client_python)
            return ServerCheck(
                ok=True,
                message=f"CARLA {version} answers at {server.host}:{server.port}.",
                version=version,
                maps=sorted(facts.maps),
                vehicles=sorted(name for name in facts.blueprints if name.startswith(_VEHICLES)),
                client=f"carla {client.client}",
            )
        return ServerCheck(
            ok=True,
            message="The start script is there; the run starts it and finds the client for it.",
        )
