"""From recorded pictures, or rays, to the points of a flash LiDAR."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.point_sensors import record_dtype
from carstage.annotation.rig import camera_geometry
from carstage.codecs.codec import image_bgra
from carstage.conversion.reprojection import Picture, RayPlaces, face_numbers, places_of_rays
from carstage.geometry import FloatArray
from carstage.geometry.flash_beams import STEEPEST, beam_directions, footprint_rays
from carstage.rawlog.reader import Record
from carstage.sensor_kinds import sensor_kind
from carstage.spec import FlashSpec, SensorSpec
from carstage.spec.flash import RETURNS

_WORD: Final = 2**64


@dataclass(frozen=True, slots=True)
class FlashEchoes:
    """What came back to a flash LiDAR in one instant.

    Attributes:
        beam: ``(N,)`` number of the beam, row by row from the top left; ascending.
        range_m: ``(N,)`` along the beam, with noise.
        power: ``(N,)`` in 1/m^2, see ``docs/formats/flash-lidar.md``.
        sample: ``(N,)`` number of the footprint's sample that gave it the most power; -1 of a
            false echo.
    """

    beam: NDArray[np.int64]
    range_m: FloatArray
    power: FloatArray
    sample: NDArray[np.int64]


def flash_payload(
    sensor: SensorSpec, records: Sequence[Record | None], noise_seed: int
) -> Picture | None:
    """The points of one tick as a LiDAR's record has them, float32 x, y, z, intensity.

    Object and tag follow, where the kind has them.

    Args:
        sensor: as it is planned.
        records: of its streams in that tick, in their order.
        noise_seed: the episode's seed of sensors' noise.

    Returns:
        None where the tick lacks one of them.

    Raises:
        ValueError: a payload does not have the size that its meta says.
    """
    found = [record for record in records if record is not None]
    if len(found) < len(sensor.streams):
        return None
    seed = frame_seed(noise_seed, sensor.id, found[0].tick)
    if is_by_rays(sensor):
        points = ray_points(sensor, found[0].meta, found[0].payload, seed)
    else:
        pictures = np.stack([image_bgra(record.meta, record.payload) for record in found])
        points = flash_points(sensor, pictures, seed)
    return {}, points.reshape(-1).view(np.uint8).data


def is_by_rays(sensor: SensorSpec) -> bool:
    """Whether a flash LiDAR's frames are made of rays, not of pictures."""
    return not sensor.blueprint.startswith("sensor.camera.")


def frame_seed(noise_seed: int, sensor_id: str, tick: int) -> int:
    """Seed of one frame of one sensor, 64 bits."""
    return (noise_seed << 32 | zlib.crc32(sensor_id.encode())) * 0x2545F4914F6CDD1D + tick & (
        _WORD - 1
    )


def flash_points(sensor: SensorSpec, pictures: NDArray[np.uint8], seed: int) -> NDArray[np.float32]:
    """``(N, 4)`` x, y, z (m, CARLA's sensor axes), intensity; beam by beam, the nearest first.

    ``(N, 6)`` with object and tag, where the kind has them.

    Args:
        sensor: as it is planned.
        pictures: ``(F, h, w, 4)`` of its streams: depth pictures, then instance pictures.
        seed: of this frame.
    """
    assert sensor.flash is not None
    faces = face_numbers(sensor)
    places = _places(sensor.flash, camera_geometry(sensor.attributes), faces)
    echoes = flash_echoes(sensor.flash, pictures[: len(faces)], places, seed)
    points = _points(sensor.flash, echoes)
    if sensor.instance is None:
        return points
    return _with_objects(points, echoes, *_picture_objects(pictures[len(faces) :], places))


def ray_points(
    sensor: SensorSpec, meta: Mapping[str, Any], payload: bytes | memoryview, seed: int
) -> NDArray[np.float32]:
    """As :func:`flash_points`, of the rays that the embedded simulator cast.

    Args:
        sensor: as it is planned.
        meta, payload: of its record, a channel for each beam.
        seed: of this frame.

    Raises:
        ValueError: the record is not one of that array.
    """
    assert sensor.flash is not None
    flash = sensor.flash
    rays = np.frombuffer(payload, record_dtype("semantic_lidar"))
    counts = np.asarray(meta["counts"], np.int64)
    if len(counts) != flash.beams or counts.sum() != len(rays):
        raise ValueError(f"{len(rays)} rays are not those of {flash.beams} beams")
    if counts.max(initial=0) > flash.samples**2:
        raise ValueError("a beam has more rays than samples")
    beam = np.repeat(np.arange(flash.beams), counts)
    place = np.arange(len(rays)) - np.repeat(np.cumsum(counts) - counts, counts)
    shape = (flash.beams, flash.samples**2)
    range_m, cosine = np.full(shape, np.inf), np.zeros(shape)
    x, y, z = (rays[name].astype(np.float64) for name in "xyz")
    range_m[beam, place] = np.sqrt(x * x + y * y + z * z)
    cosine[beam, place] = np.clip(rays["cos_incidence"].astype(np.float64), STEEPEST, 1.0)
    echoes = echoes_of_samples(flash, range_m, cosine, seed)
    points = _points(flash, echoes)
    if not sensor_kind(sensor.kind).tags_points:
        return points
    objects, tags = np.zeros(shape, np.uint32), np.zeros(shape, np.uint32)
    objects[beam, place], tags[beam, place] = rays["object_idx"], rays["object_tag"]
    return _with_objects(points, echoes, objects, tags)


def _points(flash: FlashSpec, echoes: FlashEchoes) -> NDArray[np.float32]:
    points = np.empty((len(echoes.beam), 4), np.float32)
    points[:, :3] = beam_directions(flash)[echoes.beam] * echoes.range_m[:, None]
    points[:, 3] = flash_intensity(flash, echoes)
    return points


def _with_objects(
    points: NDArray[np.float32],
    echoes: FlashEchoes,
    objects: NDArray[np.uint32],
    tags: NDArray[np.uint32],
) -> NDArray[np.float32]:
    """``(N, 6)`` points with object and tag of each echo's sample of most power.

    Args:
        points: ``(N, 4)`` of the echoes.
        echoes: see there; false ones have 0 and 0.
        objects, tags: ``(B, S)`` of the samples.
    """
    real = echoes.sample >= 0
    found = np.zeros((len(points), 2), np.float32)
    for column, values in enumerate((objects, tags)):
        found[real, column] = values[echoes.beam[real], echoes.sample[real]]
    return np.hstack([points, found])


def _picture_objects(
    pictures: NDArray[np.uint8], places: RayPlaces
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    from carstage.conversion.flash_kernel import sample_objects

    shape = places.face.shape
    objects, tags = np.empty(shape, np.uint32), np.empty(shape, np.uint32)
    sample_objects(pictures, places.face, places.place, objects, tags)
    return objects, tags


def flash_echoes(
    flash: FlashSpec, pictures: NDArray[np.uint8], places: RayPlaces, seed: int
) -> FlashEchoes:
    """Measure, find echoes, and report those that are seen.

    Args:
        flash: what is measured.
        pictures: ``(F, h, w, 4)`` depth pictures.
        places: where the samples of the footprints, ``(B, S)``, are in them.
        seed: of this frame.
    """
    from carstage.conversion.flash_kernel import sample_surfaces

    shape = places.face.shape
    range_m, cosine = np.empty(shape), np.empty(shape)
    sample_surfaces(pictures, places.face, places.place, places.focal_px, range_m, cosine)
    return echoes_of_samples(flash, range_m, cosine, seed)


def echoes_of_samples(
    flash: FlashSpec, range_m: FloatArray, cosine: FloatArray, seed: int
) -> FlashEchoes:
    """Find echoes, and report those that are seen.

    Args:
        flash: what is measured.
        range_m, cosine: ``(B, S)`` of the samples of the footprints; infinity: nothing is there.
        seed: of this frame.
    """
    from carstage.conversion.flash_kernel import find_echoes, report_echoes

    shape = range_m.shape
    echo_m, echo_power = np.empty(shape), np.empty(shape)
    echo_sample, count = np.empty(shape, np.int64), np.empty(shape[0], np.int64)
    limits_m = (flash.min_range_m, flash.range_m)
    optics = (
        _sample_rad(flash), flash.echo_separation_m, flash.reflectivity, flash.attenuation_per_m,
    )  # fmt: skip
    find_echoes(range_m, cosine, limits_m, optics, echo_m, echo_power, echo_sample, count)
    chances = (
        weakest_power(flash), flash.noise_stddev_m, flash.ambient_noise, flash.false_return_rate,
        flash.dropoff_rate,
    )  # fmt: skip
    reported = np.empty((int(count.sum()) + shape[0], 4))
    total = report_echoes(
        echo_m, echo_power, count, np.uint64(seed), limits_m, chances,
        RETURNS.index(flash.returns), reported,
    )  # fmt: skip
    beam, reported_m, power, place = reported[:total].T
    beams, echo = beam.astype(np.int64), place.astype(np.int64)
    sample = np.where(echo < 0, -1, echo_sample[beams, echo])
    return FlashEchoes(beams, reported_m, power, sample)


def weakest_power(flash: FlashSpec) -> float:
    """Power that is just seen (1/m^2): that of the darkest surface at the longest range."""
    from carstage.conversion.flash_kernel import attenuation

    left = attenuation(2.0 * flash.attenuation_per_m * flash.range_m)
    return float(flash.range_reflectivity * left / flash.range_m**2)


def flash_intensity(flash: FlashSpec, echoes: FlashEchoes) -> FloatArray:
    """``(N,)`` intensities in 0 to 1; what is brighter than full scale saturates."""
    scale = flash.full_scale_range_m or echoes.range_m
    return np.asarray(np.minimum(echoes.power * scale * scale, 1.0), dtype=np.float64)


def _sample_rad(flash: FlashSpec) -> float:
    """The longer side of a sample's share of a footprint; 0 of a line."""
    widest_deg = max(flash.horizontal_divergence_deg, flash.vertical_divergence_deg)
    return math.radians(widest_deg) / flash.samples


@lru_cache(maxsize=8)
def _places(flash: FlashSpec, source: tuple[int, int, float], faces: tuple[int, ...]) -> RayPlaces:
    return places_of_rays(footprint_rays(flash), source, faces)
