"""Maps as they are drawn from above: lanes, and where vehicles may begin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.errors import ServerError
from carstage.web.configure.description import DescriptionService
from carstage.web.messages import TownMap, TownMapRequest
from carstage.web.wording import page_words

if TYPE_CHECKING:
    from carstage.config.servers import RemoteServerConfig

_ANSWER_S = 5.0


class TownMapService:
    """Knows the embedded simulator's towns, and asks servers that run for theirs.

    Args:
        description: what the embedded simulator offers.
    """

    def __init__(self, description: DescriptionService) -> None:
        self._description = description

    def look(self, request: TownMapRequest) -> TownMap:
        """What is known of a map on the server of a configuration; a note says what is not.

        Raises:
            ConfigError: the section ``server`` is wrong.
        """
        from carstage.config import check_config
        from carstage.config.servers import (
            ClassServerConfig,
            EmbeddedServerConfig,
            RemoteServerConfig,
        )

        server = check_config({"server": request.server}).server
        name = request.map.rsplit("/", 1)[-1]
        if isinstance(server, RemoteServerConfig):
            return self._of_remote(name, server)
        if isinstance(server, ClassServerConfig):
            note = f"{server.name} tells its maps when it runs: type numbers and places."
            return TownMap(map=name, note=note)
        if not isinstance(server, EmbeddedServerConfig):
            note = "The maps of this release are known when it runs: type numbers and places."
            return TownMap(map=name, note=note)
        lanes = self._description.lanes(name)
        if lanes is None:
            return TownMap(map=name, note=f"The embedded simulator has no map {name}.")
        return TownMap(
            map=name,
            lanes=lanes["lanes"],
            lane_heights_m=lanes["heights_m"],
            lane_widths_m=lanes["widths_m"],
            spawn_points=lanes["spawn_points"],
        )

    def _of_remote(self, name: str, server: RemoteServerConfig) -> TownMap:
        from carstage.server.asking import ask_spawn_points

        try:
            loaded, points = ask_spawn_points(server.host, server.port, _ANSWER_S)
        except ServerError as error:
            return TownMap(
                map=name, note=f"{page_words(error.message)} Start it, or type numbers and places."
            )
        if loaded != name:
            note = f"The server has {loaded} loaded: of {name} nothing is known before the run."
            return TownMap(map=name, note=note)
        return TownMap(
            map=name,
            spawn_points=points[:, [0, 1, 2, 4]].round(2).tolist(),
            note="The server tells its spawn points; where its lanes are is not known.",
        )
