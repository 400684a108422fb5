"""From recorded depth pictures to the points of a flash LiDAR."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.rig import camera_geometry
from carstage.codecs.codec import image_bgra
from carstage.conversion.reprojection import Picture, RayPlaces, face_numbers, places_of_rays
from carstage.geometry import FloatArray
from carstage.geometry.flash_beams import beam_directions, footprint_rays
from carstage.rawlog.reader import Record
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
    """

    beam: NDArray[np.int64]
    range_m: FloatArray
    power: FloatArray


def flash_payload(
    sensor: SensorSpec, records: Sequence[Record | None], noise_seed: int
) -> Picture | None:
    """The points of one tick as a LiDAR's record has them, float32 x, y, z, intensity.

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
    pictures = np.stack([image_bgra(record.meta, record.payload) for record in found])
    points = flash_points(sensor, pictures, frame_seed(noise_seed, sensor.id, found[0].tick))
    return {}, points.reshape(-1).view(np.uint8).data


def frame_seed(noise_seed: int, sensor_id: str, tick: int) -> int:
    """Seed of one frame of one sensor, 64 bits."""
    return (noise_seed << 32 | zlib.crc32(sensor_id.encode())) * 0x2545F4914F6CDD1D + tick & (
        _WORD - 1
    )


def flash_points(sensor: SensorSpec, pictures: NDArray[np.uint8], seed: int) -> NDArray[np.float32]:
    """``(N, 4)`` x, y, z (m, CARLA's sensor axes), intensity; beam by beam, the nearest first.

    Args:
        sensor: as it is planned.
        pictures: ``(F, h, w, 4)`` depth pictures of its streams.
        seed: of this frame.
    """
    assert sensor.flash is not None
    flash = sensor.flash
    places = _places(flash, camera_geometry(sensor.attributes), face_numbers(sensor))
    echoes = flash_echoes(flash, pictures, places, seed)
    points = np.empty((len(echoes.beam), 4), np.float32)
    points[:, :3] = beam_directions(flash)[echoes.beam] * echoes.range_m[:, None]
    points[:, 3] = flash_intensity(flash, echoes)
    return points


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
    from carstage.conversion.flash_kernel import find_echoes, report_echoes, sample_surfaces

    shape = places.face.shape
    range_m, cosine = np.empty(shape), np.empty(shape)
    sample_surfaces(pictures, places.face, places.place, places.focal_px, range_m, cosine)
    echo_m, echo_power = np.empty(shape), np.empty(shape)
    count = np.empty(shape[0], np.int64)
    limits_m = (flash.min_range_m, flash.range_m)
    find_echoes(
        range_m, cosine, limits_m, (_sample_rad(flash), flash.echo_separation_m),
        (flash.reflectivity, flash.attenuation_per_m), echo_m, echo_power, count,
    )  # fmt: skip
    chances = (
        weakest_power(flash), flash.noise_stddev_m, flash.ambient_noise, flash.false_return_rate,
        flash.dropoff_rate,
    )  # fmt: skip
    reported = np.empty((int(count.sum()) + shape[0], 3))
    total = report_echoes(
        echo_m, echo_power, count, np.uint64(seed), limits_m, chances,
        RETURNS.index(flash.returns), reported,
    )  # fmt: skip
    beam, reported_m, power = reported[:total].T
    return FlashEchoes(beam.astype(np.int64), reported_m, power)


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
