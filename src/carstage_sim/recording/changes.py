"""What a log tells only when it changes: doors, street lamps, weather."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from carstage_sim.recording.layout import GAMMA, Packet, rows_packet
from carstage_sim.world.snapshot import Snapshot
from carstage_sim.world.state import Weather
from carstage_sim.world.street_lights import LightState, StreetLights


class Changes:
    """Finds what changed from frame to frame; everything is new to the first one.

    Args:
        street_lights: the lamps of the episode.
    """

    def __init__(self, street_lights: StreetLights) -> None:
        self._street_lights = street_lights
        self._weather: Weather | None = None
        self._doors: dict[int, int] = {}
        self._lamps: dict[int, LightState] = {}
        self._lamp_version = -1

    def since_the_last_frame(self, snapshot: Snapshot) -> list[bytes]:
        """Packets of what changed; empty ones where nothing did."""
        return [
            self._door_changes(snapshot),
            self._lamp_changes(),
            self._weather_change(snapshot.state.weather),
        ]

    def _door_changes(self, snapshot: Snapshot) -> bytes:
        """Doors that were opened or closed since the last frame."""
        state, changes = snapshot.state, []
        for row in snapshot.vehicles.rows.tolist():
            actor_id = int(state.actor_id[row])
            bits = 0 if state.doors is None else int(state.doors[row])
            changed = bits ^ self._doors.get(actor_id, 0)
            self._doors[actor_id] = bits
            changes += [
                (actor_id, door, bool(bits >> door & 1)) for door in range(8) if changed >> door & 1
            ]
        if not changes:
            return b""
        ids, doors, opened = zip(*changes, strict=True)
        return rows_packet(Packet.VEHICLE_DOOR, id=ids, door=doors, open=opened)

    def _lamp_changes(self) -> bytes:
        """All street lamps at first, then those that changed; colours are linear, as UE's are."""
        lights = self._street_lights
        if lights.version == self._lamp_version:
            return b""
        self._lamp_version = lights.version
        changed = [lamp for lamp in lights.states() if lamp != self._lamps.get(lamp.light_id)]
        self._lamps.update((lamp.light_id, lamp) for lamp in changed)
        if not changed:
            return b""
        colours = np.array([lamp.colour for lamp in changed]) / 255.0
        return rows_packet(
            Packet.SCENE_LIGHT,
            id=[lamp.light_id for lamp in changed],
            intensity=[lamp.intensity for lamp in changed],
            colour=np.concatenate([colours**GAMMA, np.ones((len(changed), 1))], axis=1),
            on=[lamp.active for lamp in changed],
            type=[lamp.group for lamp in changed],
        )

    def _weather_change(self, weather: Weather) -> bytes:
        if weather == self._weather:
            return b""
        self._weather = weather
        return rows_packet(
            Packet.WEATHER, values=[[getattr(weather, field.name) for field in fields(Weather)]]
        )
