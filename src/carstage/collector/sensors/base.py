"""The seam of the sensor kinds: what differs between them once ``carla`` has delivered data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Callable, Dict, Mapping, Tuple, Type, TypeVar

from carstage.rawlog.format import Buffer

Attributes = Mapping[str, str]


class Sensor(ABC):
    """One kind of sensor: how its data become a record.

    Nothing here holds state; ``data`` is the ``carla`` object that the callback got.

    Attributes:
        one_size: every payload has the same size, so that a file of equal slots can hold them.
    """

    one_size = False

    @classmethod
    @abstractmethod
    def expected_bytes(cls, attributes: Attributes, fps: float) -> int:
        """Upper estimate of one tick's payload, from the blueprint's final attributes."""

    @classmethod
    @abstractmethod
    def size_bytes(cls, data: Any) -> int:
        """Bytes that ``data`` keeps in memory; called in the sensor's callback, so cheap."""

    @classmethod
    @abstractmethod
    def encode(cls, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """Meta and payload of the record; the payload may be a view that needs ``data`` alive."""


SENSOR_KINDS: Dict[str, Type[Sensor]] = {}
"""Kind (``rgb``, ``lidar``) to class, filled by :func:`register`."""

SensorClass = TypeVar("SensorClass", bound=Type[Sensor])


def register(kind: str) -> Callable[[SensorClass], SensorClass]:
    """Class decorator that adds a kind to the registry."""

    def add(sensor: SensorClass) -> SensorClass:
        if kind in SENSOR_KINDS:
            raise ValueError("sensor kind %r is registered already" % kind)
        SENSOR_KINDS[kind] = sensor
        return sensor

    return add
