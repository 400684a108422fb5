"""Does a flash LiDAR measure what rays along its beams meet?

Drives are recorded with flash LiDARs that are made of depth pictures. Beside each beam goes a ray
of a semantic LiDAR, which the embedded simulator casts by itself: with the same rows, and turned by
half a column, its rays are the beams. The simulator's own flash LiDAR is compared with them, too. A
finer depth camera of the same place says which beams end at an edge, where a picture's pixel and a
line may meet different things.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.recorded import record
from carstage import Dataset
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset import Frame
from carstage.geometry import FloatArray
from carstage.geometry.flash_beams import beam_angles
from carstage.sensor_kinds.columns import Point, TaggedPoint
from carstage.spec import FlashSpec

TOWNS = ("Stage01", "Stage02", "Stage03")
COLUMNS, ROWS = 128, 32
ACROSS_DEG, UP_DEG = 60.0, 15.0
RANGE_M = 100.0
NEAR_M = 0.01
"""What ranges may be wrong by."""
ODD = 1e-4
"""Share of beams on one surface that have a point where the ray has none, or the reverse."""
SAME_TAGS = 0.999
"""Share of beams with the same tag, of those on one surface where the finer picture has one tag."""
BEYOND = 0.005
"""Share of echoes of wide beams on what is finer than either picture, such as leaves."""
_FLAT_M = 0.005
"""How far 6 x 6 pixels of the finer picture may be from one plane to be one surface."""
_POSE = {"x": 1.5, "z": 1.6}
_HALF_COLUMN_DEG = ACROSS_DEG / COLUMNS / 2.0
_TOP_DEG = UP_DEG / 2.0 - UP_DEG / ROWS / 2.0
_FPS = 5
_BEAMS: dict[str, Any] = {
    "columns": COLUMNS, "rows": ROWS, "horizontal_fov_deg": ACROSS_DEG, "vertical_fov_deg": UP_DEG,
    "range_m": RANGE_M,
}  # fmt: skip
_LINES: dict[str, Any] = {
    **_BEAMS, "samples": 1, "horizontal_divergence_deg": 0.0, "vertical_divergence_deg": 0.0,
    "reflectivity": 1.0, "full_scale_range_m": 0.0,
}  # fmt: skip
_NOISE_M = 0.03


def _sensor(name: str, kind: str, yaw_deg: float = 0.0, **attributes: Any) -> dict[str, Any]:
    return {
        "id": name, "kind": kind, "pose": {**_POSE, "yaw_deg": yaw_deg}, "attributes": attributes,
    }  # fmt: skip


_CONFIG = {
    "seed": 3,
    "fps": _FPS,
    "vehicles": {"count": 30},
    "pedestrians": {"count": 20},
    "conversion": {"workers": 1},
    "labels": {"method": "stage_vo"},
    "server": {"kind": "embedded", "self_test": "off"},
    "rig": {
        "sensors": [
            _sensor("LINES", "semantic_flash_lidar", **_LINES),
            _sensor("NOISY", "flash_lidar", **_LINES, noise_stddev_m=_NOISE_M, dropoff_rate=0.1),
            _sensor("WIDE", "flash_lidar", **_BEAMS, returns="all"),
            _sensor("CAST", "semantic_ray_flash_lidar", **_LINES),
            _sensor("WIDE_CAST", "ray_flash_lidar", **_BEAMS, returns="all"),
            _sensor("DEPTH", "depth", image_size=[2048, 640], fov_deg=66.0),
            _sensor("SEMANTIC", "semantic", image_size=[2048, 640], fov_deg=66.0),
            _sensor(
                "RAYS", "semantic_lidar", _HALF_COLUMN_DEG, channels=ROWS, range_m=RANGE_M,
                upper_fov_deg=_TOP_DEG, lower_fov_deg=-_TOP_DEG, horizontal_fov_deg=ACROSS_DEG,
                points_per_second=COLUMNS * ROWS * _FPS, rotation_frequency_hz=float(_FPS),
            ),
        ]
    },
}  # fmt: skip


@dataclass(slots=True)
class _Found:
    """What each frame has added.

    Attributes:
        flat, edges: differences of ranges to those of the rays (m), on one surface and at edges.
        depth: of those on one surface, differences to the finer depth picture (m).
        cosines: differences of intensities to the rays' cosines of incidence, on one surface.
        noise: differences of noisy ranges to those without noise (m).
        ways, ways_at_edges: differences of ranges between pictures and rays of the simulator's own
            flash LiDAR (m), on one surface and elsewhere.
        tags_to_rays, tags_of_ways: of beams on one surface with one tag, whether the tag is the
            ray's; whether pictures and rays of the simulator's own flash LiDAR give the same one.
        missing: beams without a point where the ray meets something, on one surface.
        extra: points where the ray meets nothing, on one surface.
        kept, possible: points with drop-off and without.
        outside: echoes of wide beams beyond what the finer picture has in their footprints.
        echoes, wide_beams: points of wide beams, and beams that have some.
        cast_echoes: points of wide beams by rays.
    """

    flat: list[FloatArray]
    edges: list[FloatArray]
    depth: list[FloatArray]
    cosines: list[FloatArray]
    noise: list[FloatArray]
    ways: list[FloatArray]
    ways_at_edges: list[FloatArray]
    tags_to_rays: list[NDArray[np.bool_]]
    tags_of_ways: list[NDArray[np.bool_]]
    missing: int = 0
    extra: int = 0
    kept: int = 0
    possible: int = 0
    outside: int = 0
    echoes: int = 0
    wide_beams: int = 0
    cast_echoes: int = 0


def measure_flash_lidar(
    towns: Sequence[str] = TOWNS,
    seconds: float = 4.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record and compare.

    Args:
        towns: names of built-in towns.
        seconds: simulated ones in each.
        progress: called with the recordings done and their total number.
    """
    found = _Found([], [], [], [], [], [], [], [], [])
    frames = 0
    with tempfile.TemporaryDirectory(prefix="carstage-flash-") as scratch:
        for number, town in enumerate(towns, start=1):
            folder = Path(scratch) / town
            folder.mkdir()
            dataset = record({**_CONFIG, "map": town, "duration_s": seconds}, folder)
            for frame in _frames(dataset):
                _compare(frame, found)
                frames += 1
            progress(number, len(towns))
    return Verdict("flash-lidar", (Figure("frames", frames, ">=", 1), *_figures(found)))


def _frames(dataset: Path) -> Iterator[Frame]:
    (episode,) = Dataset(dataset).episodes
    yield from episode.iter_frames()


def _figures(found: _Found) -> Iterator[Figure]:
    flat, edges = np.concatenate(found.flat), np.concatenate(found.edges)
    depth, cosines = np.concatenate(found.depth), np.concatenate(found.cosines)
    noise = np.concatenate(found.noise)
    yield Figure("beams_on_one_surface", len(flat), ">=", 1000)
    yield Figure("range_error_to_rays_m_p99", float(np.quantile(flat, 0.99)), "<=", NEAR_M)
    yield Figure("range_error_to_depth_m_p99", float(np.quantile(depth, 0.99)), "<=", NEAR_M)
    ways, at_edges = np.concatenate(found.ways), np.concatenate(found.ways_at_edges)
    yield Figure("difference_between_ways_m_p99", float(np.quantile(ways, 0.99)), "<=", NEAR_M)
    yield Figure("share_of_ways_within_1_cm_at_edges", float((at_edges <= NEAR_M).mean()))
    yield Figure("share_of_tags_of_rays", _share(found.tags_to_rays), ">=", SAME_TAGS)
    yield Figure("share_of_tags_alike_between_ways", _share(found.tags_of_ways), ">=", SAME_TAGS)
    yield Figure("echoes_by_rays_over_those_by_pictures", found.cast_echoes / found.echoes)
    yield Figure("share_within_1_cm_at_edges_and_leaves", float((edges <= NEAR_M).mean()))
    yield Figure("share_of_beams_at_edges_and_leaves", len(edges) / (len(edges) + len(flat)))
    odd = (found.missing + found.extra) / len(flat)
    yield Figure("share_of_points_too_few_or_too_many", odd, "<=", ODD)
    yield Figure("cosine_error_median", float(np.median(cosines)), "<=", 0.01)
    yield Figure("noise_stddev_over_asked", float(noise.std() / _NOISE_M), ">=", 0.98)
    yield Figure("noise_stddev_asked_over_found", float(_NOISE_M / noise.std()), ">=", 0.98)
    yield Figure("noise_mean_over_asked", abs(float(noise.mean())) / _NOISE_M, "<=", 0.02)
    yield Figure("points_kept_of_0.9", found.kept / found.possible / 0.9, ">=", 0.99)
    yield Figure("0.9_of_points_over_kept", 0.9 * found.possible / found.kept, ">=", 0.99)
    beyond = found.outside / found.echoes
    yield Figure("share_of_echoes_beyond_their_footprints", beyond, "<=", BEYOND)
    yield Figure("echoes_per_wide_beam", found.echoes / found.wide_beams)


def _share(same: Sequence[NDArray[np.bool_]]) -> float:
    return float(np.concatenate(same).mean())


def _compare(frame: Frame, found: _Found) -> None:
    lidar = frame.episode.sensor("LINES").calibration
    assert lidar.flash is not None
    lines, noisy = (_by_beam(frame.read(name), lidar.flash) for name in ("LINES", "NOISY"))
    rays = frame.read("RAYS")
    turned = np.stack([rays["x"], rays["y"], rays["z"]], axis=1).astype(np.float64)
    ray_m = _by_beam(turned, lidar.flash, _HALF_COLUMN_DEG)
    cosine = np.full(ray_m.shape, np.nan)
    cosine[~np.isnan(ray_m)] = np.abs(rays["cos_incidence"])[
        np.argsort(_beams_of(turned, lidar.flash, _HALF_COLUMN_DEG), kind="stable")
    ]
    depth = frame.read("DEPTH").astype(np.float64)
    depth_m, bend = _depth_ranges(depth, frame, lidar.flash)
    flat = bend * depth_m <= _FLAT_M
    both = ~np.isnan(lines) & ~np.isnan(ray_m)
    error = np.abs(lines - ray_m)
    found.flat.append(error[both & flat])
    found.edges.append(error[both & ~flat])
    found.depth.append(np.abs(lines - depth_m)[both & flat])
    cast = _by_beam(frame.read("CAST"), lidar.flash)
    between = np.abs(lines - cast)
    known = ~np.isnan(between)
    found.ways.append(between[known & flat])
    found.ways_at_edges.append(between[known & ~flat])
    found.cast_echoes += len(frame.read("WIDE_CAST"))
    one_tag = flat & _have_one_tag(frame, lidar.flash)
    tags = _column_by_beam(frame.read("LINES"), lidar.flash, TaggedPoint.TAG)
    cast_tags = _column_by_beam(frame.read("CAST"), lidar.flash, TaggedPoint.TAG)
    ray_tags = np.full(ray_m.shape, np.nan)
    ray_tags[_beams_of(turned, lidar.flash, _HALF_COLUMN_DEG)] = rays["object_tag"]
    found.tags_to_rays.append((tags == ray_tags)[both & one_tag])
    found.tags_of_ways.append((tags == cast_tags)[known & one_tag])
    inner = flat & (ray_m < RANGE_M - 1.0)
    found.missing += int((np.isnan(lines) & ~np.isnan(ray_m) & inner).sum())
    found.extra += int((~np.isnan(lines) & np.isnan(ray_m) & flat & (lines < RANGE_M - 1.0)).sum())
    intensity = _column_by_beam(frame.read("LINES"), lidar.flash, Point.INTENSITY)
    found.cosines.append(np.abs(intensity - cosine)[both & flat])
    found.noise.append((noisy - lines)[~np.isnan(noisy) & ~np.isnan(lines)])
    found.kept += int((~np.isnan(noisy)).sum())
    found.possible += int((~np.isnan(lines)).sum())
    _compare_wide(frame, depth, found)


def _beams_of(points: NDArray[Any], flash: FlashSpec, turned_deg: float = 0.0) -> NDArray[np.intp]:
    """Number of the beam that each point lies on."""
    azimuth, elevation = beam_angles(flash)
    x, y, z = points[:, :3].astype(np.float64).T
    across = np.arctan2(y, x) + np.radians(turned_deg)
    up = np.arctan2(z, np.hypot(x, y))
    column = np.rint((across - azimuth[0]) / (azimuth[1] - azimuth[0])).astype(np.intp)
    row = np.rint((up - elevation[0]) / (elevation[1] - elevation[0])).astype(np.intp)
    return np.asarray(row * flash.columns + column)


def _column_by_beam(points: NDArray[Any], flash: FlashSpec, column: int) -> FloatArray:
    """``(beams,)`` a column of the points, NaN without a point."""
    values = np.full(flash.beams, np.nan)
    values[_beams_of(points, flash)] = points[:, column]
    return values


def _by_beam(points: NDArray[Any], flash: FlashSpec, turned_deg: float = 0.0) -> FloatArray:
    """``(beams,)`` ranges, NaN without a point."""
    ranges = np.full(flash.beams, np.nan)
    distances = np.linalg.norm(points[:, :3].astype(np.float64), axis=1)
    ranges[_beams_of(points, flash, turned_deg)] = distances
    return ranges


def _depth_ranges(
    depth: FloatArray, frame: Frame, flash: FlashSpec
) -> tuple[FloatArray, FloatArray]:
    """``(beams,)`` range where the finer picture has each beam, and how far 1/depth bends there."""
    x, y, u, v = _places(frame, flash)
    i, j = np.floor(u).astype(np.intp), np.floor(v).astype(np.intp)
    inverse = 1.0 / depth
    a, b = u - i, v - j
    upper = (1 - a) * inverse[j, i] + a * inverse[j, i + 1]
    lower = (1 - a) * inverse[j + 1, i] + a * inverse[j + 1, i + 1]
    ranges = np.sqrt(1.0 + x * x + y * y) / ((1 - b) * upper + b * lower)
    around = [inverse[j + dv, i + du] for dv in range(-2, 4) for du in range(-2, 4)]
    at = np.array([(du, dv, 1.0) for dv in range(-2, 4) for du in range(-2, 4)])
    values = np.stack(around)
    planes = np.linalg.lstsq(at, values, rcond=None)[0]
    bend = np.abs(values - at @ planes).max(axis=0) / values.mean(axis=0)
    return ranges, bend


def _places(frame: Frame, flash: FlashSpec) -> tuple[FloatArray, ...]:
    """``(beams,)`` slopes to the right and down, and pixels from the middle of the first one."""
    azimuth, elevation = np.meshgrid(*beam_angles(flash))
    camera = frame.episode.sensor("DEPTH").calibration
    x = np.tan(azimuth).reshape(-1)
    y = (-np.tan(elevation) / np.cos(azimuth)).reshape(-1)
    return (
        x,
        y,
        camera.k[0, 0] * x + camera.k[0, 2] - 0.5,
        camera.k[1, 1] * y + camera.k[1, 2] - 0.5,
    )


def _have_one_tag(frame: Frame, flash: FlashSpec) -> NDArray[np.bool_]:
    """``(beams,)`` whether 6 x 6 pixels of the finer picture have one tag; lines are paint."""
    _, _, u, v = _places(frame, flash)
    i, j = np.floor(u).astype(np.intp), np.floor(v).astype(np.intp)
    picture = frame.read("SEMANTIC")
    around = np.stack([picture[j + dv, i + du] for dv in range(-2, 4) for du in range(-2, 4)])
    return np.asarray((around == around[0]).all(axis=0))


def _compare_wide(frame: Frame, depth: FloatArray, found: _Found) -> None:
    """Each echo of a wide beam lies between what the finer picture has in its footprint."""
    flash = frame.episode.sensor("WIDE").calibration.flash
    assert flash is not None
    camera = frame.episode.sensor("DEPTH").calibration
    points = frame.read("WIDE")
    beams = _beams_of(points, flash)
    ranges = np.linalg.norm(points[:, :3].astype(np.float64), axis=1)
    azimuth, elevation = beam_angles(flash)
    half_px = np.radians(ACROSS_DEG / COLUMNS) * camera.k[0, 0] * 0.75 + 2.0
    for beam, range_m in zip(beams, ranges, strict=True):
        across, up = azimuth[beam % flash.columns], elevation[beam // flash.columns]
        x, y = np.tan(across), -np.tan(up) / np.cos(across)
        u, v = camera.k[0, 0] * x + camera.k[0, 2], camera.k[1, 1] * y + camera.k[1, 2]
        rows = slice(max(int(v - half_px), 0), int(v + half_px) + 1)
        columns = slice(max(int(u - half_px), 0), int(u + half_px) + 1)
        stretch = np.sqrt(1.0 + x * x + y * y)
        nearest, farthest = depth[rows, columns].min(), depth[rows, columns].max()
        inside = 0.98 * nearest <= range_m / stretch <= 1.02 * farthest
        found.outside += not inside
    found.echoes += len(points)
    found.wide_beams += len(np.unique(beams))
