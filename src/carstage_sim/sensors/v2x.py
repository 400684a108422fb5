"""V2X sensors as receivers: which of the messages of a tick arrive, and how strongly."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import Town
from carstage_sim.sensors.attributes import flag, number, require
from carstage_sim.sensors.cam import CamNoise, cam_message, text_message
from carstage_sim.sensors.measurements import SensorRequest, V2xFrame
from carstage_sim.sensors.path_loss import (
    Edge,
    PathState,
    RadioPath,
    RadioSettings,
    path_loss_db,
)
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import ActorKind, WorldState
from carstage_sim.world.transmissions import CAM_SENSOR, CUSTOM_SENSOR, Transmission

_ABOVE_ROOF_M = 0.02
_NEAREST_M = 1e-2
_MOST_WAITING = 4096
"""Messages of ticks without a report that are kept; older ones are lost."""

_Place = tuple[NDArray[np.float64], float]
"""An antenna, world metres, and the height of its station's base."""


class _Receiver(MeasuringSensor):
    """Hears the messages of other stations that are strong enough (``PathLossModel.cpp``).

    Messages of ticks in which it has no turn, by ``sensor_tick`` or because the server had no time
    to look, come with the next report. They then take the way of that tick.
    """

    sent_by: ClassVar[str]

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self.radio = RadioSettings.read(request.attributes)
        self.seed = CamNoise(request.attributes).seed
        self._waiting: deque[Transmission] = deque(maxlen=_MOST_WAITING)

    def observe(self, state: WorldState, request: SensorRequest) -> None:
        """Keep the messages of a tick."""
        station = request.owner_id or request.sensor_id
        self._waiting.extend(
            sent
            for sent in state.transmissions
            if sent.type_id == self.sent_by and sent.station_id != station
        )

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> V2xFrame | None:
        """The messages that arrive, in the order in which they were sent."""
        self.observe(state, request)
        sent = tuple(self._waiting)
        self._waiting.clear()
        if not sent:
            return None
        own = _place(state, view, request.owner_id, request.location)
        others = [_place(state, view, one.station_id, one.antenna) for one in sent]
        near = [
            place
            for place, (antenna, _) in enumerate(others)
            if math.dist(antenna, own[0]) < self.radio.filter_distance
        ]
        reached = [(sent[place], others[place]) for place in near]
        paths = self._paths(state, view, request, own, reached)
        received = []
        for place, path in zip(near, paths, strict=True):
            power_dbm = self._power_dbm(state, request, sent[place], path)
            if power_dbm >= self.radio.receiver_sensitivity:
                received.append(self.message(sent[place], power_dbm, request))
        return V2xFrame(np.concatenate(received)) if received else None

    @abstractmethod
    def message(
        self, sent: Transmission, power_dbm: float, request: SensorRequest
    ) -> NDArray[np.void]:
        """``(1,)`` a message as the client reads it."""

    def _power_dbm(
        self, state: WorldState, request: SensorRequest, sent: Transmission, path: RadioPath
    ) -> float:
        random = np.random.default_rng(
            [self.seed & 0xFFFFFFFF or request.sensor_id, state.frame, sent.sensor_id, sent.frame]
        )
        fading_db = float(random.normal(0.0, 1.0)) * self.radio.fading_db(path.state)
        power_dbm = RadioSettings.read(sent.attributes).transmit_power
        loss_db = path_loss_db(path, self.radio) + fading_db
        return power_dbm + self.radio.combined_antenna_gain - loss_db

    def _paths(
        self,
        state: WorldState,
        view: View,
        request: SensorRequest,
        own: _Place,
        senders: Sequence[tuple[Transmission, _Place]],
    ) -> list[RadioPath]:
        """The ways from the senders' antennas to this sensor's."""
        if not senders:
            return []
        antenna, base_m = own
        starts = np.array([place for _, (place, _) in senders])
        moving = state.actor_id[np.isin(state.kind, (ActorKind.VEHICLE, ActorKind.WALKER))]
        bodies = {one.station_id for one, _ in senders} | {request.owner_id, *moving.tolist()}
        blocked = view.are_obstructed(starts, antenna, frozenset(bodies))
        vehicles = _vehicle_rows(state, view)
        paths = []
        for is_blocked, (one, (start, start_base_m)) in zip(blocked, senders, strict=True):
            ends = (request.owner_id, one.station_id)
            between = vehicles[~np.isin(view.frame.actor_id[vehicles], ends)]
            lowest_m = min(base_m, start_base_m)
            edges = [] if is_blocked else _edges(view, between, start, antenna, lowest_m)
            paths.append(
                RadioPath(
                    distance_m=max(math.dist(start, antenna), _NEAREST_M),
                    sender_height_m=max(float(start[2]) - lowest_m, _ABOVE_ROOF_M),
                    receiver_height_m=max(float(antenna[2]) - lowest_m, _ABOVE_ROOF_M),
                    state=_path_state(blocked=bool(is_blocked), edges=edges),
                    edges=edges,
                )
            )
        return paths


@SensorRegistry.register(CAM_SENSOR)
class V2xSensor(_Receiver):
    """Cooperative awareness messages of other stations."""

    sent_by = CAM_SENSOR

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        shortest_s = number(request.attributes, "gen_cam_min", 0.1)
        longest_s = number(request.attributes, "gen_cam_max", 1.0)
        flag(request.attributes, "fixed_rate", default=False)
        require(
            0.0 <= shortest_s <= longest_s,
            f"gen_cam_min is {shortest_s:g} s, not 0 to gen_cam_max ({longest_s:g} s)",
        )

    def message(
        self, sent: Transmission, power_dbm: float, request: SensorRequest
    ) -> NDArray[np.void]:
        """``(1,)`` of :data:`carstage_sim.sensors.cam.CAM_DATA`."""
        return cam_message(sent, power_dbm, self.town.geo_reference, request.projection)


@SensorRegistry.register(CUSTOM_SENSOR)
class CustomV2xSensor(_Receiver):
    """Texts that clients let other stations send."""

    sent_by = CUSTOM_SENSOR

    def message(
        self, sent: Transmission, power_dbm: float, request: SensorRequest
    ) -> NDArray[np.void]:
        """``(1,)`` of :data:`carstage_sim.sensors.cam.CUSTOM_DATA`."""
        return text_message(sent, power_dbm)


def _place(
    state: WorldState, view: View, station_id: int, antenna: tuple[float, float, float]
) -> _Place:
    """Where a station's antenna is: just above its roof; where its sensor is if it has no body."""
    (rows,) = np.nonzero(view.frame.actor_id == station_id)
    (known,) = np.nonzero(state.actor_id == station_id)
    base_m = float(state.location[known[0], 2]) if len(known) else antenna[2]
    if not station_id or not len(rows) or not len(known):
        return np.array(antenna), base_m
    roof_m = float(view.frame.bounds[rows, 1, 2].max())
    x, y, z = state.location[known[0]].tolist()
    return np.array((x, y, z + roof_m + _ABOVE_ROOF_M)), z


def _vehicle_rows(state: WorldState, view: View) -> NDArray[np.intp]:
    kinds = state.kind[np.searchsorted(state.actor_id, view.frame.actor_id)]
    is_body = view.frame.body == np.arange(len(kinds))
    return np.flatnonzero(is_body & (kinds == ActorKind.VEHICLE))


def _edges(
    view: View,
    rows: NDArray[np.intp],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    lowest_m: float,
) -> list[Edge]:
    """The vehicles whose boxes the straight line between two antennas goes through."""
    scene, bounds = view.frame.scene, view.frame.bounds
    found = []
    for row in rows:
        middle = np.asarray(scene.position[row], np.float64)
        rotation = np.asarray(scene.rotation[row], np.float64)
        if _meets_box((start - middle) @ rotation, (end - middle) @ rotation, bounds[row]):
            height_m = float(middle[2] + bounds[row, 1, 2]) + _ABOVE_ROOF_M - lowest_m
            found.append(
                Edge(math.dist(start[:2], middle[:2]), math.dist(end[:2], middle[:2]), height_m)
            )
    return found


def _meets_box(
    start: NDArray[np.float64], end: NDArray[np.float64], box: NDArray[np.float32]
) -> bool:
    """Whether a segment goes through an upright box, all in the box's frame (slabs)."""
    along = end - start
    first, last = 0.0, 1.0
    for axis in range(3):
        low, high = float(box[0, axis]), float(box[1, axis])
        if along[axis] == 0.0:
            if not low <= start[axis] <= high:
                return False
            continue
        enter, leave = sorted(
            ((low - start[axis]) / along[axis], (high - start[axis]) / along[axis])
        )
        first, last = max(first, enter), min(last, leave)
    return first <= last


def _path_state(*, blocked: bool, edges: Sequence[Edge]) -> PathState:
    if blocked:
        return PathState.BUILDINGS
    return PathState.VEHICLES if edges else PathState.LINE_OF_SIGHT
