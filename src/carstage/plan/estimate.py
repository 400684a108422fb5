"""What a run will need: bytes on disk and, roughly, time.

Sizes are meant to be on the safe side; the table of sensor kinds has those of pixels and points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import is_not
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.config import Config
from carstage.plan.episodes import EpisodePlan
from carstage.plan.rig import geometry
from carstage.plan.stereo import planned_pairs
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.model import VOXELS
from carstage.spec import EpisodeSpec, ReplaySpec, SensorSpec, StoryboardSpec

COST = np.dtype(
    [
        ("dataset_bytes", np.int64),
        ("raw_bytes", np.int64),
        ("duration_s", np.float64),
        ("steps", np.int64),
        ("frames", np.int64),
    ]
)
"""What an episode will need; see :func:`episode_cost`."""

_BYTES_PER_ACTOR = 68
_BYTES_PER_RECORD = 512  # header, padding, JSON
_LABEL_BYTES = 400  # one row of the label tables after compression, generously
_SMALL_SENSOR_BYTES = 64
_GRID_BYTES = 2048  # of a bird's-eye grid, beside its cells
_CELL_BYTES = 0.35
_VOXEL_BYTES = 0.1
_DISPARITY_BYTES = 1.0  # of a pixel
_OCCUPIED = 0.15  # of exact voxels, between houses

# Seconds on a machine with 2 cores of 2.5 GHz: the embedded simulator with all kernels cached.
_START_S = 12.0
_TICK_S = 0.05
_CAMERA_PIXEL_S = 3.0e-7
_LIDAR_RAY_S = 4.0e-7


@dataclass(frozen=True, slots=True)
class RunEstimate:
    """Upper estimate of a run.

    Attributes:
        dataset_bytes: all episodes in the dataset.
        raw_bytes: the raw logs of all episodes.
        peak_bytes: the most that is on disk at once.
        duration_s: wall time on a 2-core machine with the embedded simulator.
    """

    dataset_bytes: int
    raw_bytes: int
    peak_bytes: int
    duration_s: float


def estimate_run(config: Config, episodes: Sequence[EpisodeSpec], workers: int = 1) -> RunEstimate:
    """Estimate the episodes that are still to be recorded.

    Args:
        config: says what is kept on the way.
        episodes: a plan, which knows its costs, or specifications.
        workers: which record at the same time on one disk.
    """
    costs = costs_of(episodes)
    raw = costs["raw_bytes"]
    kept = config.output.keep_raw or config.conversion.mode == "deferred"
    kept_at_once = len(raw) if kept else 2 * workers
    dataset_bytes = int(costs["dataset_bytes"].sum())
    return RunEstimate(
        dataset_bytes=dataset_bytes,
        raw_bytes=int(raw.sum()),
        peak_bytes=dataset_bytes + int(np.sort(raw)[-kept_at_once:].sum()),
        duration_s=_START_S + float(costs["duration_s"].sum()),
    )


def costs_of(episodes: Sequence[EpisodeSpec]) -> NDArray[Any]:
    """``(N,)`` of ``COST``: what each episode will need."""
    if isinstance(episodes, EpisodePlan):
        return episodes.costs
    return np.array([episode_cost(spec) for spec in episodes], COST)


def episode_cost(spec: EpisodeSpec) -> tuple[int, int, float, int, int]:
    """What an episode will need: bytes in the dataset and raw, seconds, steps, saved frames."""
    return _dataset_bytes(spec), _raw_bytes(spec), _duration_s(spec), spec.steps, spec.saved_frames


class EpisodeCosts:
    """Costs of episodes that have their sensors in common; what comes again is not computed again.

    One is for one plan.
    """

    def __init__(self) -> None:
        self._rigs: tuple[object, ...] = ()
        self._known: dict[tuple[Any, ...], tuple[int, int, float, int, int]] = {}

    def of(self, spec: EpisodeSpec) -> tuple[int, int, float, int, int]:
        """:func:`episode_cost` of a specification."""
        rigs = (spec.sensors, *(agent.sensors for agent in spec.agents))
        if len(rigs) != len(self._rigs) or any(map(is_not, rigs, self._rigs)):
            self._rigs = rigs  # kept, so no others can have their identity
            self._known.clear()
        users = (road_users(spec), spec.pedestrians.count)
        key = (*users, spec.steps, spec.fps, spec.save_every, spec.warmup_ticks)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = episode_cost(spec)
        return found


def road_users(spec: EpisodeSpec) -> int:
    """Vehicles, pedestrians, the ego and the agents beside it."""
    if isinstance(spec.scenario, ReplaySpec):
        return len(spec.scenario.actors)
    if isinstance(spec.scenario, StoryboardSpec):
        return len(spec.scenario.entities)
    agents = sum(agent.vehicle is not None for agent in spec.agents)
    return spec.vehicles.total + spec.pedestrians.count + 1 + agents


def _pixels(sensor: SensorSpec) -> int:
    attributes = sensor.attributes
    return int(attributes["image_size_x"]) * int(attributes["image_size_y"])


def _written_data(sensor: SensorSpec) -> int:
    """Pixels or points of a frame in the dataset; what they are made from may have more."""
    if sensor.flash is not None:
        return sensor.flash.most_points
    lens = sensor.lens
    return _pixels(sensor) if lens is None else lens.width * lens.height


def _rays(sensor: SensorSpec, fps: float) -> int:
    return round(int(sensor.attributes["points_per_second"]) / fps)


def _file_bytes(sensor: SensorSpec) -> float:
    """What a pixel or a point takes in the dataset."""
    kind = sensor_kind(sensor.kind)
    return kind.datum_bytes if kind.file_bytes is None else kind.file_bytes


def _raw_bytes(spec: EpisodeSpec) -> int:
    actors = road_users(spec) + spec.pedestrians.count + len(spec.streams) + 60
    per_frame: int = 0
    for sensor in spec.streams.values():
        per_frame += _BYTES_PER_RECORD
        if "image_size_x" in sensor.attributes:
            per_frame += sensor_kind(sensor.kind).raw_bytes * _pixels(sensor)
        elif "points_per_second" in sensor.attributes:
            per_frame += sensor_kind(sensor.kind).raw_bytes * _rays(sensor, spec.fps)
        elif sensor.flash is not None:
            rays = sensor.flash.beams * sensor.flash.samples**2
            per_frame += sensor_kind(sensor.kind).raw_bytes * rays
        elif sensor.content == VOXELS and spec.labels.occupancy is not None:
            occupied = _OCCUPIED * math.prod(spec.labels.occupancy.cells)
            per_frame += round(sensor_kind(sensor.kind).raw_bytes * occupied)
    per_tick: int = _BYTES_PER_ACTOR * actors + 4 * _BYTES_PER_RECORD
    return spec.saved_frames * per_frame + spec.steps * per_tick


def _dataset_bytes(spec: EpisodeSpec) -> int:
    objects = road_users(spec)
    per_frame = 0.0
    for sensor in spec.streams.values():
        if sensor.labelled:
            per_frame += _LABEL_BYTES * objects
        if sensor.hidden:
            continue
        if "image_size_x" in sensor.attributes or sensor.flash is not None:
            per_frame += _file_bytes(sensor) * _written_data(sensor)
        elif "points_per_second" in sensor.attributes:
            per_frame += _file_bytes(sensor) * _rays(sensor, spec.fps)
        else:
            per_frame += _SMALL_SENSOR_BYTES
    if spec.labels.disparity:
        for sensors in (spec.sensors, *(agent.sensors for agent in spec.agents)):
            for pair in planned_pairs(sensors):
                per_frame += 2 * _DISPARITY_BYTES * pair.left.width * pair.left.height
    views = 1 + len(spec.agents)
    if spec.labels.birds_eye is not None:
        asked = spec.labels.birds_eye
        cells = asked.length_m * asked.width_m / asked.resolution_m**2
        per_frame += views * (_GRID_BYTES + _CELL_BYTES * cells)
    if spec.labels.occupancy is not None:
        cells = math.prod(spec.labels.occupancy.cells)
        per_frame += views * (_GRID_BYTES + _VOXEL_BYTES * cells)
    return round(spec.saved_frames * (per_frame + _LABEL_BYTES * objects * views))


def _duration_s(spec: EpisodeSpec) -> float:
    ticks = spec.steps + spec.warmup_ticks
    return ticks * _TICK_S + spec.saved_frames * (estimate_tick_s(spec) - _TICK_S)


def estimate_tick_s(spec: EpisodeSpec) -> float:
    """Wall time of a step that is saved, on a 2-core machine with the embedded simulator.

    Cameras of one pose and one set of intrinsics share one cast, so they count once.
    """
    casts = {
        (number, sensor.pose, tuple(sorted(geometry(sensor.attributes).items()))): _pixels(sensor)
        for number, rig in enumerate((spec.sensors, *(agent.sensors for agent in spec.agents)))
        for sensor in rig
        if "image_size_x" in sensor.attributes
    }
    rays = sum(
        _rays(sensor, spec.fps)
        for sensor in spec.streams.values()
        if "points_per_second" in sensor.attributes
    )
    return _TICK_S + sum(casts.values()) * _CAMERA_PIXEL_S + rays * _LIDAR_RAY_S
