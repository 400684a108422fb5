"""What a sensor is: one object per listening sensor, made from the registry by blueprint id."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, TypeVar

from carstage_sim.maps.town import Town
from carstage_sim.sensors.attributes import number
from carstage_sim.sensors.measurements import SensorFrame, SensorRequest
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

_DUE_TOLERANCE_S = 1e-6


class Sensor(ABC):
    """One sensor of the world; it may remember earlier ticks.

    Args:
        request: the sensor's first request; its attributes hold for the sensor's life.
        town: the map, for sensors that know where on Earth they are.

    Attributes:
        looks: whether it asks the view for anything. One that does not measures in every tick,
            however long pictures take.
        may_be_late: whether its reports may be made after later ticks. That needs reports that
            depend on their own tick and on reports before alone, some of which may be left out,
            and pays for those that take long.
        beside_others: whether its reports may be made in another thread than those of other
            sensors, at the same time. It then shares nothing with them but the view.
        many_steps: whether its reports take many steps one after the other. They are begun first:
            other reports then fill the gaps, not the end.
        casts_rays: whether it looks along rays. From within its carrier's box one that does passes
            through the carrier; one that does not has the carrier in its reports.
    """

    looks: ClassVar[bool] = True
    may_be_late: ClassVar[bool] = False
    beside_others: ClassVar[bool] = False
    many_steps: ClassVar[bool] = False
    casts_rays: ClassVar[bool] = True

    def __init__(self, request: SensorRequest, town: Town) -> None:
        self.request = request
        self.town = town
        self._interval_s = number(request.attributes, "sensor_tick", 0.0)
        self._due_s: float | None = None

    @property
    def pixels(self) -> int:
        """Pixels of a picture that it makes, 0 where that is none."""
        return 0

    @abstractmethod
    def report(
        self, state: WorldState, request: SensorRequest, view: View
    ) -> Sequence[SensorFrame]:
        """What the sensor sends in this tick; called once per tick at which it is due."""

    def observe(self, state: WorldState, request: SensorRequest) -> None:  # noqa: B027
        """See a tick at which the sensor is not due; for sensors that integrate over ticks."""

    def answers(self, request: SensorRequest) -> bool:
        """Whether a request is still for this sensor, not for a new one with its id."""
        return (
            self.request.type_id == request.type_id
            and self.request.attributes == request.attributes
        )

    def is_due(self, timestamp_s: float) -> bool:
        """Whether ``sensor_tick`` seconds have passed since the last frame; counts the frame.

        One of 0 or less means every tick, as an actor's tick interval does in Unreal Engine.
        """
        if self._interval_s <= _DUE_TOLERANCE_S:
            return True
        if self._due_s is None:
            self._due_s = timestamp_s
        if timestamp_s < self._due_s - _DUE_TOLERANCE_S:
            return False
        # One step if ticks are shorter than the interval; counted, as there may be any number.
        late_s = timestamp_s + _DUE_TOLERANCE_S - self._due_s
        self._due_s += (math.floor(late_s / self._interval_s) + 1) * self._interval_s
        return True

    def announce(  # noqa: B027
        self, state: WorldState, request: SensorRequest, view: View
    ) -> None:
        """Say which pictures :meth:`report` will ask for; a card then makes them side by side."""


class MeasuringSensor(Sensor):
    """A sensor that sends at most one frame whenever it is due."""

    @abstractmethod
    def measure(self, state: WorldState, request: SensorRequest, view: View) -> SensorFrame | None:
        """The frame of this tick, None for nothing to send."""

    def report(
        self, state: WorldState, request: SensorRequest, view: View
    ) -> Sequence[SensorFrame]:
        """The one frame of this tick, or none."""
        frame = self.measure(state, request, view)
        return () if frame is None else (frame,)


_S = TypeVar("_S", bound=Sensor)


class SensorRegistry:
    """Sensor classes by blueprint id."""

    _classes: ClassVar[dict[str, type[Sensor]]] = {}

    @classmethod
    def register(cls, type_id: str) -> Callable[[type[_S]], type[_S]]:
        """Class decorator: sensors of ``type_id`` are made from this class."""

        def add(sensor_class: type[_S]) -> type[_S]:
            cls._classes[type_id] = sensor_class
            return sensor_class

        return add

    @classmethod
    def known(cls) -> tuple[str, ...]:
        """Blueprint ids that can be made, sorted."""
        return tuple(sorted(cls._classes))

    @classmethod
    def looks(cls, type_id: str) -> bool:
        """Whether sensors of a blueprint id need to see the town and the actors."""
        return type_id not in cls._classes or cls._classes[type_id].looks

    @classmethod
    def may_be_late(cls, type_id: str) -> bool:
        """Whether reports of a blueprint id's sensors may be made after later ticks."""
        return type_id in cls._classes and cls._classes[type_id].may_be_late

    @classmethod
    def make(cls, request: SensorRequest, town: Town) -> Sensor:
        """A new sensor.

        Raises:
            KeyError: no class is registered for the request's blueprint id.
        """
        if request.type_id not in cls._classes:
            raise KeyError(f"{request.type_id} is none of {', '.join(cls.known())}")
        return cls._classes[request.type_id](request, town)
