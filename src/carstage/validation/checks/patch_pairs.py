"""Variants with and without patches show the same world, but for the patches' pixels."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.schema import EGO_COLUMNS, PATCH_COLUMNS, PATCHES
from carstage.dataset.reading import Episode, Sensor
from carstage.dataset.saved_frames import RowsByFrame
from carstage.dataset.variants import EpisodeVariants
from carstage.errors import CarStageError
from carstage.sensor_kinds.model import COLOUR, DEPTH
from carstage.spec import EpisodeSpec
from carstage.spec.patches import PatchSpec
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.table_schema import require_rows, require_schema

_RIM_PX = 3.0
"""Pixels at the edge of a patch are the mean of rays on both sides, and smaller ones take the
colours of larger pieces of its texture: at a slant of larger ones still."""
_RIM_OF_SLANT_PX = 2.0
_LEAST_FACING = 0.06
_WET = ("precipitation", "precipitation_deposits", "wetness")
"""Weather in which surfaces mirror what stands beside them."""


@dataclass(slots=True)
class PairFigures:
    """What was compared.

    Attributes:
        images: pictures that two variants both have.
        pixels: of colour pictures, outside of patches.
        differing: of them, those that are not equal.
        mirrored: those that differ in wet weather, where the road mirrors patches.
    """

    images: int = 0
    pixels: int = 0
    differing: int = 0
    mirrored: int = 0

    def to_dict(self) -> dict[str, int]:
        """For the report."""
        return {
            "images": self.images,
            "pixels": self.pixels,
            "differing": self.differing,
            "mirrored": self.mirrored,
        }


def check_patch_pairs(variants: EpisodeVariants, findings: Findings, figures: PairFigures) -> None:
    """Compare every two variants that differ in their patches alone (check ``patch_pairs``).

    Colour pictures must be equal outside of the patches, depth pictures everywhere. In wet weather
    surfaces mirror patches: what differs there is counted, and is no error.

    Args:
        variants: of one episode.
        findings: where problems go.
        figures: what was compared, added to.
    """
    for one, other in combinations(variants.names, 2):
        first, second = variants[one], variants[other]
        if _are_pair(first.spec, second.spec):
            try:
                _compare(first, second, findings, figures)
            except CarStageError:
                continue  # the checks of its files say so


def _are_pair(one: EpisodeSpec, other: EpisodeSpec) -> bool:
    """Whether one shows the patches, the other not, and they have all else in common."""
    if not (one.patches and other.patches):
        return False
    if one.patches[0].is_shown == other.patches[0].is_shown:
        return False
    plain, same = (replace(spec, variant=None, patches=_unshown(spec)) for spec in (one, other))
    return plain == same


def _unshown(spec: EpisodeSpec) -> tuple[PatchSpec, ...]:
    return tuple(replace(patch, shown=None) for patch in spec.patches)


def _compare(one: Episode, other: Episode, findings: Findings, figures: PairFigures) -> None:
    table = one.patches()
    if table is None:
        return
    require_rows(table, PATCH_COLUMNS, PATCHES)
    rows = RowsByFrame(table)
    sensors = {sensor.id: sensor for sensor in other.sensors}
    is_wet = _is_wet(one)
    for sensor in one.sensors:
        twin = sensors.get(sensor.id)
        if twin is None or not sensor.calibration.is_lossless:
            continue
        labelled = sensor.calibration.labelled and sensor.calibration.is_pinhole
        if sensor.content == DEPTH or (sensor.content == COLOUR and labelled):
            for k in range(min(one.frames, other.frames)):
                seen = [row for row in rows.rows(k) if row["sensor_id"] == sensor.id]
                images = _read(sensor, twin, k)
                if images is not None:
                    _compare_images(sensor, k, seen, images, is_wet, findings, figures)


def _read(sensor: Sensor, twin: Sensor, k: int) -> tuple[NDArray[Any], NDArray[Any]] | None:
    try:
        return sensor.read(k), twin.read(k)
    except CarStageError:
        return None  # the ledger, or the checks of its files, say why


def _compare_images(
    sensor: Sensor,
    k: int,
    rows: list[dict[str, Any]],
    images: tuple[NDArray[Any], NDArray[Any]],
    is_wet: bool,
    findings: Findings,
    figures: PairFigures,
) -> None:
    """Count the pixels that differ outside of the patches."""
    first, second = images
    figures.images += 1
    differs = first != second
    if sensor.content == DEPTH:
        if differs.any():
            message = f"{sensor.id}: depth differs with and without the patches"
            findings.add("patch_pairs", message, frame=k, sensor=sensor.id)
        return
    outside = ~patch_pixels(rows, first.shape[0], first.shape[1])
    wrong = int((differs.any(axis=2) & outside).sum())
    figures.pixels += int(outside.sum())
    if is_wet:
        figures.mirrored += wrong
        return
    figures.differing += wrong
    if wrong:
        message = f"{sensor.id}: {wrong} pixels outside of the patches differ with and without them"
        findings.add("patch_pairs", message, frame=k, sensor=sensor.id)


def patch_pixels(rows: list[dict[str, Any]], height: int, width: int) -> NDArray[np.bool_]:
    """``(H, W)`` pixels whose middle is in the outline of a patch, or near it.

    Whether something stands before a patch is not asked: it may be a pane.

    Args:
        rows: of ``patches.parquet``, of one picture.
        height, width: of the picture.
    """
    inside = np.zeros((height, width), np.bool_)
    v, u = np.mgrid[:height, :width] + 0.5
    for row in rows:
        outline = np.stack([row["u"], row["v"]], axis=1)
        slant = max(float(row["facing"]), _LEAST_FACING)
        rim_px = _RIM_PX + _RIM_OF_SLANT_PX / slant
        after = np.roll(outline, -1, axis=0)
        area = (outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]).sum()
        near = np.ones((height, width), np.bool_)
        for (au, av), (bu, bv) in zip(outline, after, strict=True):
            length = float(np.hypot(bu - au, bv - av))
            if length > 0.0:
                side = ((bu - au) * (v - av) - (bv - av) * (u - au)) / length
                near &= (side if area > 0.0 else -side) >= -rim_px
        inside |= near
    return inside


def _is_wet(episode: Episode) -> bool:
    """Whether it rains, or water lies anywhere, in some frame of an episode."""
    table = episode.ego()
    require_schema(table, [c for c in EGO_COLUMNS if c.name == "weather"], "ego.parquet")
    texts = table["weather"].unique().to_pylist()
    weathers = [json.loads(text) for text in texts if text is not None]
    return any(float(one.get(name, 0.0)) > 0.0 for one in weathers for name in _WET)
