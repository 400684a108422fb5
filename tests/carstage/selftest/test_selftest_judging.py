"""Each fault of a server is found and named: a sound recording, spoilt in one way at a time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carstage.geometry import FloatArray, GeoFrame, range_per_depth
from carstage.releases import NORTHS, PROJECTIONS, North, Projection
from carstage.selftest import judge_log
from carstage.selftest.alignment import check_actors, check_pictures, check_poses
from carstage.selftest.codes import check_instance_ids, check_tags
from carstage.selftest.depth_view import DepthView, check_depth
from carstage.selftest.evidence import Evidence
from carstage.selftest.frame_consistency import check_frames, check_mounts
from carstage.selftest.globe import check_gnss
from carstage.selftest.lidar_axes import check_lidar_axes
from carstage.selftest.optical_flow import check_optical_flow
from carstage.selftest.scene_setup import FPS
from carstage.selftest.verdict import Verdict
from carstage.tags import TAGS_0_9_13, new_tag

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("selftest")]


@pytest.fixture(scope="module")
def view(evidence: Evidence) -> DepthView:
    return check_depth(evidence)[1]


def with_pictures(evidence: Evidence, **pictures: Any) -> Evidence:
    return replace(evidence, pictures={**evidence.pictures, **pictures})


def late(pictures: Any) -> Any:
    """Every tick gets the picture of the tick before."""
    return np.concatenate([pictures[:1], pictures[:-1]])


def depth_code(depth_m: FloatArray) -> Any:
    code = np.round(depth_m / 1000.0 * (2**24 - 1)).astype(np.uint32)
    channels = [code >> 16 & 255, code >> 8 & 255, code & 255, np.full_like(code, 255)]
    return np.stack(channels, axis=-1).astype(np.uint8)


def test_embedded_simulator_passes_every_check(recorded: Path) -> None:
    verdict = judge_log(recorded)
    assert verdict.ok, [check.line() for check in verdict.checks]
    assert [check.name for check in verdict.checks] == [
        "frames",
        "mounts",
        "depth code",
        "camera poses",
        "rgb pictures",
        "semantic pictures",
        "instance pictures",
        "actor poses",
        "instance ids",
        "semantic tags",
        "optical flow",
        "LiDAR axes",
        "GNSS",
    ]
    assert verdict.gnss == {"projection": "transverse_mercator", "north": "+y"}
    assert verdict.to_json()["ok"] is True
    assert verdict.to_json()["server"] == "0.9.16"


def test_frame_with_another_number_is_named(evidence: Evidence) -> None:
    spoilt = list(evidence.records["rgb"])
    spoilt[3] = replace(spoilt[3], frame=spoilt[3].frame + 1)
    found = check_frames(replace(evidence, records={**evidence.records, "rgb": spoilt}))
    assert not found.ok
    assert "rgb" in found.found
    assert str(evidence.worlds[3].frame) in found.found


def test_sensor_that_dates_its_data_otherwise_is_named(evidence: Evidence) -> None:
    late_by_one = [
        replace(record, meta={**record.meta, "sensor_timestamp_s": world.timestamp_s - 1.0 / FPS})
        for record, world in zip(evidence.records["depth"], evidence.worlds, strict=True)
    ]
    found = check_frames(replace(evidence, records={**evidence.records, "depth": late_by_one}))
    assert not found.ok
    assert f"depth dated frame {evidence.worlds[0].frame}" in found.found


def test_sensor_that_stands_elsewhere_is_named(evidence: Evidence) -> None:
    moved = evidence.world_from_camera.copy()
    moved[2, 0, 3] += 0.1
    found = check_mounts(replace(evidence, world_from_camera=moved))
    assert not found.ok
    assert "depth stands 0.100 m" in found.found


def test_depth_along_the_ray_is_recognised(evidence: Evidence, view: DepthView) -> None:
    height, width = view.depth_m.shape[1:]
    along_ray = np.minimum(view.depth_m * range_per_depth(width, height, 90.0), 1000.0)
    found, read = check_depth(with_pictures(evidence, depth=depth_code(along_ray)))
    assert not found.ok
    assert "along the ray" in found.found
    assert check_poses(read).ok  # what comes after reads the pictures by the code that was found


def test_depth_with_its_bytes_reversed_is_recognised(evidence: Evidence) -> None:
    reversed_bytes = evidence.pictures["depth"][..., [2, 1, 0, 3]]
    found, _ = check_depth(with_pictures(evidence, depth=reversed_bytes))
    assert not found.ok
    assert "B + 256 G + 65536 R" in found.found


def test_pictures_that_lag_behind_their_poses_are_found(evidence: Evidence) -> None:
    spoilt = with_pictures(evidence, depth=late(evidence.pictures["depth"]))
    depth, view = check_depth(spoilt)
    assert depth.ok
    found = check_poses(view)
    assert not found.ok
    assert found.found == "those of 1 tick before"


@pytest.mark.parametrize("camera", ["rgb", "semantic", "instance"])
def test_camera_that_lags_behind_the_depth_camera_is_found(
    evidence: Evidence, view: DepthView, camera: str
) -> None:
    spoilt = with_pictures(evidence, **{camera: late(evidence.pictures[camera])})
    found = check_pictures(replace(view, evidence=spoilt), camera)
    assert not found.ok
    assert found.found == "those of 1 tick before"


def test_actors_that_lag_in_the_snapshot_are_found(evidence: Evidence, view: DepthView) -> None:
    vehicle = replace(evidence.vehicle, world_from_box=late(evidence.vehicle.world_from_box))
    found = check_actors(replace(view, evidence=replace(evidence, vehicle=vehicle)))
    assert not found.ok
    assert found.found == "where the snapshot 1 tick after has them"


def test_instance_ids_with_swapped_bytes_are_recognised(
    evidence: Evidence, view: DepthView
) -> None:
    swapped = evidence.pictures["instance"][..., [1, 0, 2, 3]]
    spoilt = replace(view, evidence=with_pictures(evidence, instance=swapped))
    found = check_instance_ids(spoilt, actor_ids_needed=True)
    assert not found.ok
    assert found.found == "actor ids, B + 256 G"


def test_ids_that_are_no_actors_matter_only_where_labels_need_them(
    evidence: Evidence, view: DepthView
) -> None:
    foreign = evidence.pictures["instance"].copy()
    foreign[..., :2] ^= 0x5A
    spoilt = replace(view, evidence=with_pictures(evidence, instance=foreign))
    assert not check_instance_ids(spoilt, actor_ids_needed=True).ok
    found = check_instance_ids(spoilt, actor_ids_needed=False)
    assert found.ok
    assert found.found == "no actor ids"


def test_old_numbering_of_tags_is_recognised(evidence: Evidence, view: DepthView) -> None:
    old_from_new = np.zeros(256, np.uint8)
    for old in TAGS_0_9_13:
        old_from_new[new_tag(old)] = old
    pictures = evidence.pictures["semantic"].copy()
    pictures[..., 2] = old_from_new[pictures[..., 2]]
    spoilt = replace(view, evidence=with_pictures(evidence, semantic=pictures))
    assert check_tags(spoilt, "0.9.13").ok
    found = check_tags(spoilt, "0.10.0")
    assert not found.ok
    assert found.found == "numbered as up to 0.9.13"


def test_unknown_numbering_of_tags_is_told(evidence: Evidence, view: DepthView) -> None:
    pictures = evidence.pictures["semantic"] + np.uint8(40)
    spoilt = replace(view, evidence=with_pictures(evidence, semantic=pictures))
    found = check_tags(spoilt, "0.10.0")
    assert not found.ok
    assert "vehicle 54" in found.found


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        ((1.0, -1.0), "shares of half the image, x right, y down, since the tick before"),
        ((-1.0, 1.0), "shares of half the image, x left, y up, since the tick before"),
        ((0.5, 0.5), "shares of all the image, x right, y up, since the tick before"),
    ],
)
def test_other_readings_of_optical_flow_are_recognised(
    evidence: Evidence, view: DepthView, scale: tuple[float, float], words: str
) -> None:
    flow = evidence.pictures["flow"] * np.array(scale, np.float32)
    found = check_optical_flow(replace(view, evidence=with_pictures(evidence, flow=flow)))
    assert not found.ok
    assert found.found == words


def test_flow_that_no_reading_explains_is_told(evidence: Evidence, view: DepthView) -> None:
    still = np.zeros_like(evidence.pictures["flow"])
    found = check_optical_flow(replace(view, evidence=with_pictures(evidence, flow=still)))
    assert not found.ok
    assert found.found == "no known reading"


@pytest.mark.parametrize(
    ("points_as", "words"),
    [
        (lambda p: p * [1.0, -1.0, 1.0], "x forward, y left, z up"),
        (lambda p: p[:, [1, 0, 2]], "x right, y forward, z up"),
    ],
)
def test_other_axes_of_the_lidar_are_recognised(
    evidence: Evidence, view: DepthView, points_as: Any, words: str
) -> None:
    spoilt = replace(evidence, points=[points_as(points) for points in evidence.points])
    found = check_lidar_axes(replace(view, evidence=spoilt))
    assert not found.ok
    assert found.found == words


def test_failed_checks_are_named_and_said_with_what_was_expected(evidence: Evidence) -> None:
    moved = evidence.world_from_camera.copy()
    moved[2, 0, 3] += 0.1
    found = check_mounts(replace(evidence, world_from_camera=moved))
    verdict = Verdict("0.9.16", "0.9.16", "Stage01", (check_frames(evidence), found))
    assert verdict.failed == ("mounts",)
    assert found.line().startswith("FAIL mounts")
    assert "expected: sensors stand where they were attached" in found.line()


def with_gnss(evidence: Evidence, frame: GeoFrame, off_m: float = 0.0) -> Evidence:
    """Readings as a server of another convention would give them."""
    assert evidence.world_from_gnss is not None
    places = [frame.gnss_place(pose[:3, 3] + [off_m, 0, 0]) for pose in evidence.world_from_gnss]
    readings = [(p.latitude_deg, p.longitude_deg, p.altitude_m) for p in places]
    records = [
        replace(record, payload=np.array(reading, "<f8").tobytes())
        for record, reading in zip(evidence.records["gnss"], readings, strict=True)
    ]
    return replace(evidence, records={**evidence.records, "gnss": records})


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("north", NORTHS)
def test_the_projection_of_a_server_is_found(
    evidence: Evidence, projection: Projection, north: North
) -> None:
    reference = GeoFrame.from_json(evidence.header["geo_reference"]).reference
    frame = GeoFrame(reference, projection, north)
    check, found = check_gnss(with_gnss(evidence, frame))
    assert check.ok, check.line()
    assert found == (projection, north)


def test_readings_of_no_known_projection_are_named(evidence: Evidence) -> None:
    frame = GeoFrame.from_json(evidence.header["geo_reference"])
    check, found = check_gnss(with_gnss(evidence, frame, off_m=1.0))
    assert (check.ok, check.found, found) == (False, "no known projection", None)
    assert check.figure == pytest.approx(1.0, abs=0.01)
