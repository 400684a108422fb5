"""What differs between the protocol versions, as tables.

The client never announces its version, so a server speaks one dialect per port. A new version is a
new :class:`Dialect` in :data:`DIALECTS`; no other module branches on a version. Structs need no
entry: every client ignores trailing fields that it does not know, so all get the longest form (and
the failure state of a vehicle lies where 0.9.13 has padding).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from carstage_sim.sensors.projection import GeoProjection
from carstage_sim.wire.dialect_tables import (
    BLUEPRINTS_SINCE_0_9_15,
    CALLS_SINCE_0_9_14,
    CALLS_SINCE_0_9_15,
    CALLS_SINCE_0_9_16,
    COMMANDS_0_9_13,
    COMMANDS_0_9_14,
    LABELS_0_9_13,
    SENSORS_0_9_13,
    SENSORS_0_9_14,
    SENSORS_0_9_16,
    WORLD_OBSERVER,
)
from carstage_sim.wire.errors import UnknownProtocolError
from carstage_sim.world.blueprints import sent_as

_FIRST_STREAM = 1


@dataclass(frozen=True, slots=True)
class Dialect:
    """One protocol version.

    Attributes:
        version: what the ``version`` call answers.
        attribute_type_base: number of the attribute type ``bool``; the others follow.
        sensors: the sensor registry in its order; a message's ``sensor_type`` is an index in it.
        commands: the commands of ``apply_batch`` in their order.
        missing_calls: calls that only later versions have.
        missing_blueprints: blueprints that only later versions have, apart from sensors.
        reopens_episode: whether the client opens a new episode after ``load_new_episode``; one that
            does not waits for the new episode's number on the stream that it already has.
        rereads_lights: whether the client may be told to fetch the street lights again; 0.9.13
            hangs when it is told so between a change of its own and the next frame.
        labels: semantic label of 0.9.14 and later -> this version's, where they differ.
        projection: how GNSS sensors find their place on the globe.
    """

    version: str
    attribute_type_base: int
    sensors: tuple[str, ...]
    commands: tuple[str, ...]
    missing_calls: frozenset[str] = frozenset()
    missing_blueprints: frozenset[str] = frozenset()
    reopens_episode: bool = False
    rereads_lights: bool = True
    labels: Mapping[int, int] = field(default_factory=dict)
    projection: GeoProjection = GeoProjection.MERCATOR

    @property
    def world_observer(self) -> int:
        """Registry index of the world-observer message."""
        return self.sensors.index(WORLD_OBSERVER)

    def label(self, label: int) -> int:
        """This version's number of a :class:`carstage_sim.labels.CityObjectLabel`."""
        return self.labels.get(label, label)

    def offers(self, type_id: str) -> bool:
        """Whether the version knows a blueprint: its sensors must be in the registry."""
        if type_id.startswith("sensor."):
            return sent_as(type_id) in self.sensors
        return type_id not in self.missing_blueprints

    def episode_stream(self, stream_id: int) -> int:
        """The stream of an episode's snapshots, of which the world numbers one per episode."""
        return stream_id if self.reopens_episode else _FIRST_STREAM


DIALECTS: Mapping[str, Dialect] = {
    "0.9.13": Dialect(
        version="0.9.13",
        attribute_type_base=0,
        sensors=SENSORS_0_9_13,
        commands=COMMANDS_0_9_13,
        missing_calls=CALLS_SINCE_0_9_14 | CALLS_SINCE_0_9_15 | CALLS_SINCE_0_9_16,
        missing_blueprints=BLUEPRINTS_SINCE_0_9_15,
        rereads_lights=False,
        labels=LABELS_0_9_13,
    ),
    "0.9.14": Dialect(
        version="0.9.14",
        attribute_type_base=0,
        sensors=SENSORS_0_9_14,
        commands=COMMANDS_0_9_14,
        missing_calls=CALLS_SINCE_0_9_15 | CALLS_SINCE_0_9_16,
        missing_blueprints=BLUEPRINTS_SINCE_0_9_15,
    ),
    "0.9.15": Dialect(
        version="0.9.15",
        attribute_type_base=0,
        sensors=SENSORS_0_9_14,
        commands=COMMANDS_0_9_14,
        missing_calls=CALLS_SINCE_0_9_16,
    ),
    "0.9.16": Dialect(
        version="0.9.16",
        attribute_type_base=1,
        sensors=SENSORS_0_9_16,
        commands=COMMANDS_0_9_14,
        reopens_episode=True,
        projection=GeoProjection.TRANSVERSE_MERCATOR,
    ),
}


def dialect(version: str) -> Dialect:
    """The dialect of a protocol version.

    Raises:
        UnknownProtocolError: no table for that version is built in.
    """
    try:
        return DIALECTS[version]
    except KeyError:
        raise UnknownProtocolError(version, tuple(DIALECTS)) from None
