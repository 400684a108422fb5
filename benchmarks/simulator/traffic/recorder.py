"""Fills a recording while the real client ticks."""

from __future__ import annotations

import math
from collections import deque
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import carla
import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.traffic.recording import NO_LIGHT, FloatArray, Partner, Recording

_LANES_EVERY_S = 1.0
_SENSOR = "sensor.other.collision"
_STEP_M = 0.5
_STEPS_TO_JUNCTION = 200
_SAME_LINE_M = 1.0


class Recorder:
    """Watches vehicles, walkers and lights; a context manager that owns the collision sensors.

    Args:
        world: in synchronous mode; it has ticked since the actors were spawned.
        vehicles, walkers: whom to watch.
        ticks: how many ticks there will be.
        delta_s: simulated seconds of a tick.
    """

    def __init__(
        self,
        world: carla.World,
        vehicles: list[carla.Vehicle],
        walkers: list[carla.Walker],
        *,
        ticks: int,
        delta_s: float,
    ) -> None:
        self._world, self._vehicles, self._walkers = world, vehicles, walkers
        self._map = world.get_map()
        self._delta_s = delta_s
        self._lights = sorted(
            world.get_actors().filter("traffic.traffic_light"), key=lambda light: int(light.id)
        )
        self._first_frame = world.get_snapshot().frame + 1
        self._motion = np.full((ticks, len(vehicles), 6), np.nan, np.float32)
        self._light_state = np.full((ticks, len(vehicles)), NO_LIGHT, np.uint8)
        self._signal_state = np.zeros((ticks, len(self._lights)), np.uint8)
        self._walker_location = np.full((ticks, len(walkers), 3), np.nan, np.float32)
        self._lanes: list[FloatArray] = []
        self._lane_tick: list[int] = []
        self._lanes_every = max(round(_LANES_EVERY_S / delta_s), 1)
        self._collisions: deque[tuple[int, int, int, int]] = deque()
        self._resources = ExitStack()
        self._tick = 0

    def __enter__(self) -> Recorder:
        blueprint = self._world.get_blueprint_library().find(_SENSOR)
        for vehicle in self._vehicles:
            sensor = self._world.spawn_actor(blueprint, carla.Transform(), vehicle)
            sensor.listen(self._note_collision)
            self._resources.callback(sensor.stop)
        return self

    def __exit__(self, *_exception: object) -> None:
        self._resources.close()

    def _note_collision(self, event: carla.CollisionEvent) -> None:
        other = event.other_actor
        kind = {"v": Partner.VEHICLE, "w": Partner.WALKER}.get(other.type_id[0], Partner.SCENERY)
        self._collisions.append((event.frame, event.actor.id, other.id, kind))

    def sample(self) -> None:
        """Takes the current frame; to be called once after each tick."""
        tick, snapshot = self._tick, self._world.get_snapshot()
        self._tick += 1
        looks_at_lanes = tick % self._lanes_every == 0
        lanes = np.full((len(self._vehicles), 3), np.nan) if looks_at_lanes else None
        for row, vehicle in enumerate(self._vehicles):
            state = snapshot.find(vehicle.id)
            if state is None:
                continue
            transform = state.get_transform()
            place = transform.location
            self._motion[tick, row] = (
                place.x,
                place.y,
                place.z,
                transform.rotation.yaw,
                state.get_velocity().length(),
                vehicle.get_speed_limit(),
            )
            if vehicle.is_at_traffic_light():
                self._light_state[tick, row] = int(vehicle.get_traffic_light_state())
            if lanes is not None:
                lanes[row] = self._lane_of(place)
        for row, light in enumerate(self._lights):
            self._signal_state[tick, row] = int(light.get_state())
        for row, walker in enumerate(self._walkers):
            state = snapshot.find(walker.id)
            if state is not None:
                place = state.get_transform().location
                self._walker_location[tick, row] = (place.x, place.y, place.z)
        if lanes is not None:
            self._lanes.append(lanes)
            self._lane_tick.append(tick)

    def _lane_of(self, place: carla.Location) -> tuple[float, float, bool]:
        """Distance from the middle of the nearest driving lane, its half width, in a junction."""
        waypoint = self._map.get_waypoint(place, lane_type=carla.LaneType.Driving)
        middle, right = waypoint.transform.location, waypoint.transform.get_right_vector()
        offset = (place.x - middle.x) * right.x + (place.y - middle.y) * right.y
        return abs(offset), waypoint.lane_width / 2.0, waypoint.is_junction

    def recording(self, *, ticks_per_s: float, wake_ups: int) -> Recording:
        """Everything that was sampled so far, with what the map holds."""
        boxes = [vehicle.bounding_box for vehicle in self._vehicles]
        lanes = np.array(self._lanes).reshape(-1, len(self._vehicles), 3)
        buildings = self._world.get_level_bbs(carla.CityObjectLabel.Buildings)
        collisions = np.array(self._collisions, np.int64).reshape(-1, 4)
        collisions = collisions[np.lexsort(collisions.T[::-1])]
        stop_signal, stop_pose, stop_width = self._stop_lines()
        return Recording(
            town=Path(self._map.name).name,
            delta_s=self._delta_s,
            vehicle_id=np.array([vehicle.id for vehicle in self._vehicles], np.int64),
            vehicle_type=np.array([vehicle.type_id for vehicle in self._vehicles], np.str_),
            box_center=_vectors(box.location for box in boxes),
            box_extent=_vectors(box.extent for box in boxes),
            location=self._motion[: self._tick, :, :3],
            yaw_deg=self._motion[: self._tick, :, 3],
            speed=self._motion[: self._tick, :, 4],
            speed_limit_kmh=self._motion[: self._tick, :, 5],
            light_state=self._light_state[: self._tick],
            walker_location=self._walker_location[: self._tick],
            signal_id=np.array([light.id for light in self._lights], np.int64),
            signal_state=self._signal_state[: self._tick],
            stop_signal=stop_signal,
            stop_pose=stop_pose,
            stop_width_m=stop_width,
            lane_tick=np.array(self._lane_tick, np.int64),
            lane_offset_m=lanes[..., 0],
            lane_half_width_m=lanes[..., 1],
            in_junction=lanes[..., 2] > 0.5,
            collision_tick=collisions[:, 0] - self._first_frame,
            collision_vehicle=collisions[:, 1],
            collision_other=collisions[:, 2],
            collision_kind=collisions[:, 3].astype(np.uint8),
            building_center=_vectors(box.location for box in buildings),
            building_extent=_vectors(box.extent for box in buildings),
            building_yaw_deg=np.array([box.rotation.yaw for box in buildings], np.float64),
            ticks_per_s=ticks_per_s,
            wake_ups=wake_ups,
        )

    def _stop_lines(self) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """Where each light's signal holds on its lanes, but not inside the junction."""
        signal: list[int] = []
        pose: list[tuple[float, float, float, float]] = []
        width: list[float] = []
        for row, light in enumerate(self._lights):
            for lane in light.get_affected_lane_waypoints():
                waypoint = _outside_junction(lane)
                place = waypoint.transform.location
                line = (place.x, place.y, place.z, waypoint.transform.rotation.yaw)
                # Several ways through a junction may begin on one lane.
                if any(math.dist(line[:2], other[:2]) < _SAME_LINE_M for other in pose):
                    continue
                signal.append(row)
                pose.append(line)
                width.append(waypoint.lane_width)
        return (
            np.array(signal, np.int64),
            np.array(pose, np.float64).reshape(-1, 4),
            np.array(width, np.float64),
        )


def _outside_junction(waypoint: carla.Waypoint) -> carla.Waypoint:
    """The place itself, or the last one of its lane before the junction that it lies in."""
    for _ in range(_STEPS_TO_JUNCTION):
        behind = waypoint.previous(_STEP_M) if waypoint.is_junction else []
        if not behind:
            break
        waypoint = behind[0]
    return waypoint


def _vectors(of: Any) -> FloatArray:
    rows = [(vector.x, vector.y, vector.z) for vector in of]
    return np.array(rows, np.float64).reshape(-1, 3)
