"""What a run will need: bytes on disk and, roughly, time.

Sizes are meant to be on the safe side; the table of sensor kinds has those of pixels and points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from carstage.config import Config
from carstage.plan.rig import geometry
from carstage.sensor_kinds import sensor_kind
from carstage.spec import EpisodeSpec, ReplaySpec, SensorSpec

_BYTES_PER_ACTOR = 68
_BYTES_PER_RECORD = 512  # header, padding, JSON
_LABEL_BYTES = 400  # one row of the label tables after compression, generously
_SMALL_SENSOR_BYTES = 64

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
    """Estimate the episodes that are still to be recorded, by so many workers on one disk."""
    raw = [_raw_bytes(spec) for spec in episodes]
    dataset_bytes = sum(_dataset_bytes(spec) for spec in episodes)
    kept = config.output.keep_raw or config.conversion.mode == "deferred"
    kept_at_once = len(raw) if kept else 2 * workers
    return RunEstimate(
        dataset_bytes=dataset_bytes,
        raw_bytes=sum(raw),
        peak_bytes=dataset_bytes + sum(sorted(raw)[-kept_at_once:]),
        duration_s=_START_S + sum(_duration_s(spec) for spec in episodes),
    )


def road_users(spec: EpisodeSpec) -> int:
    """Vehicles, pedestrians and the ego."""
    if isinstance(spec.scenario, ReplaySpec):
        return len(spec.scenario.actors)
    return spec.vehicles.total + spec.pedestrians.count + 1


def _pixels(sensor: SensorSpec) -> int:
    attributes = sensor.attributes
    return int(attributes["image_size_x"]) * int(attributes["image_size_y"])


def _rays(sensor: SensorSpec, fps: float) -> int:
    return round(int(sensor.attributes["points_per_second"]) / fps)


def _file_bytes(sensor: SensorSpec) -> float:
    """What a pixel or a point takes in the dataset."""
    kind = sensor_kind(sensor.kind)
    return kind.raw_bytes if kind.file_bytes is None else kind.file_bytes


def _raw_bytes(spec: EpisodeSpec) -> int:
    actors = road_users(spec) + spec.pedestrians.count + len(spec.sensors) + 60
    per_frame: int = 0
    for sensor in spec.sensors:
        per_frame += _BYTES_PER_RECORD
        if "image_size_x" in sensor.attributes:
            per_frame += sensor_kind(sensor.kind).raw_bytes * _pixels(sensor)
        elif "points_per_second" in sensor.attributes:
            per_frame += sensor_kind(sensor.kind).raw_bytes * _rays(sensor, spec.fps)
    per_tick: int = _BYTES_PER_ACTOR * actors + 4 * _BYTES_PER_RECORD
    return spec.saved_frames * per_frame + spec.steps * per_tick


def _dataset_bytes(spec: EpisodeSpec) -> int:
    objects = road_users(spec)
    per_frame = 0.0
    for sensor in spec.sensors:
        if sensor.labelled:
            per_frame += _LABEL_BYTES * objects
        if sensor.hidden:
            continue
        if "image_size_x" in sensor.attributes:
            per_frame += _file_bytes(sensor) * _pixels(sensor)
        elif "points_per_second" in sensor.attributes:
            per_frame += _file_bytes(sensor) * _rays(sensor, spec.fps)
        else:
            per_frame += _SMALL_SENSOR_BYTES
    return round(spec.saved_frames * (per_frame + _LABEL_BYTES * objects))


def _duration_s(spec: EpisodeSpec) -> float:
    ticks = spec.steps + spec.warmup_ticks
    return ticks * _TICK_S + spec.saved_frames * (estimate_tick_s(spec) - _TICK_S)


def estimate_tick_s(spec: EpisodeSpec) -> float:
    """Wall time of a step that is saved, on a 2-core machine with the embedded simulator.

    Cameras of one pose and one set of intrinsics share one cast, so they count once.
    """
    casts = {
        (sensor.pose, tuple(sorted(geometry(sensor.attributes).items()))): _pixels(sensor)
        for sensor in spec.sensors
        if "image_size_x" in sensor.attributes
    }
    rays = sum(
        _rays(sensor, spec.fps)
        for sensor in spec.sensors
        if "points_per_second" in sensor.attributes
    )
    return _TICK_S + sum(casts.values()) * _CAMERA_PIXEL_S + rays * _LIDAR_RAY_S
