"""What the embedded simulator offers, asked once and kept."""

from __future__ import annotations

import logging
import threading
from collections import defaultdict
from typing import Any

from carstage.errors import CarStageError
from carstage.web.errors import not_found
from carstage.web.messages import DescriptionMessage, MapEntry, VehicleEntry

_VEHICLES = "vehicle."

_log = logging.getLogger("carstage.web")


class DescriptionService:
    """Maps, blueprints, shapes of vehicles, lanes of maps; each asked for once.

    The simulator answers in processes of its own: it is never imported here.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._message: DescriptionMessage | None = None
        self._answers: dict[tuple[str, str], dict[str, Any]] = {}
        self._asking: defaultdict[tuple[str, str], threading.Lock] = defaultdict(threading.Lock)

    def warm(self, vehicle: str, cancelled: threading.Event) -> None:
        """Ask what pages will ask first, so that they need not wait: after an update of the
        simulator each answer takes seconds.

        Args:
            vehicle: whose shape the first page shows; one of another server is left out.
            cancelled: ends it before the next question.
        """
        try:
            message = self.message()
            if not cancelled.is_set() and vehicle in {entry.id for entry in message.vehicles}:
                self.vehicle(vehicle)
            for entry in message.maps:
                if cancelled.is_set():
                    return
                self.lanes(entry.name)
        except CarStageError as error:
            _log.warning("the embedded simulator cannot be described: %s", error)

    def message(self) -> DescriptionMessage:
        """All of it but shapes and lanes.

        Raises:
            ServerError: the simulator cannot describe itself.
        """
        with self._lock:
            if self._message is None:
                self._message = self._describe()
            return self._message

    def vehicle(self, blueprint: str) -> dict[str, Any]:
        """The shape of a vehicle.

        Raises:
            WebError: there is no such vehicle.
            ServerError: the simulator does not answer.
        """
        if blueprint not in {vehicle.id for vehicle in self.message().vehicles}:
            raise not_found(f"vehicle {blueprint}")
        return self._ask("--vehicle", blueprint)

    def lanes(self, map_name: str) -> dict[str, Any] | None:
        """The lanes of a map of the embedded simulator; None for another map."""
        short = map_name.rsplit("/", 1)[-1]
        if short not in {entry.name for entry in self.message().maps}:
            return None
        return self._ask("--lanes", short)

    def _ask(self, option: str, name: str) -> dict[str, Any]:
        question = (option, name)
        with self._lock:
            asking = self._asking[question]
        with asking:  # others may ask something else meanwhile
            if question not in self._answers:
                from carstage.server import ask_embedded

                self._answers[question] = ask_embedded(option, name)
            return self._answers[question]

    def _describe(self) -> DescriptionMessage:
        from carstage.config import WEATHER_PRESETS
        from carstage.sensor_kinds import kinds
        from carstage.server import describe_embedded

        described = describe_embedded()
        blueprints = described.blueprints
        return DescriptionMessage(
            protocol=described.protocol,
            maps=[
                MapEntry(name=name, spawn_points=count) for name, count in described.maps.items()
            ],
            vehicles=[
                VehicleEntry(
                    id=blueprint.id,
                    base_type=blueprint.attributes.get("base_type", ""),
                    generation=blueprint.attributes.get("generation", ""),
                    wheels=int(blueprint.attributes.get("number_of_wheels", "4")),
                    colors=list(blueprint.recommended.get("color", ())),
                )
                for blueprint in blueprints.values()
                if blueprint.id.startswith(_VEHICLES)
            ],
            walkers=[name for name in blueprints if name.startswith("walker.pedestrian.")],
            weathers=list(WEATHER_PRESETS),
            sensors={
                kind.name: dict(blueprints[kind.blueprint].attributes)
                for kind in kinds()
                if kind.blueprint in blueprints
            },
        )
