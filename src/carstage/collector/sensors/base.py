"""The seam of the sensor kinds: what differs between them once ``carla`` has delivered data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import lru_cache
from typing import Any, Dict, Mapping, Tuple

from carstage.rawlog.format import Buffer
from carstage.sensor_kinds import SensorKind, load_object, sensor_kind

Attributes = Mapping[str, str]


class Sensor(ABC):
    """One kind of sensor: how its data become a record.

    It remembers nothing between records; ``data`` is the ``carla`` object that the callback got.

    Args:
        kind: the row of the table.

    Attributes:
        one_size: every payload has the same size, so that a file of equal slots can hold them.
    """

    one_size = False

    def __init__(self, kind: SensorKind) -> None:
        self.kind = kind
        self.datum_bytes = kind.raw_bytes

    @abstractmethod
    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """Upper estimate of one tick's payload, from the blueprint's final attributes."""

    @abstractmethod
    def size_bytes(self, data: Any) -> int:
        """Bytes that ``data`` keeps in memory; called in the sensor's callback, so cheap."""

    @abstractmethod
    def encode(self, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """Meta and payload of the record; the payload may be a view that needs ``data`` alive."""


@lru_cache(maxsize=None)
def sensor_of(kind: str) -> Sensor:
    """What makes records of the data of a kind.

    Raises:
        KeyError: there is no such kind.
        ImportError: the class that its row names cannot be imported.
    """
    row = sensor_kind(kind)
    sensor: Sensor = load_object(row.collector)(row)
    return sensor
