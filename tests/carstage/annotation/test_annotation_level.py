"""Level objects and riders: who gets a row, with which columns, from which pixels."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import annotation_scenes
from annotation_scenes import CAR_EXTENT, CAR_TAG, EGO_ID, RIDER_TAG, PaintedImages, actor, snapshot
from carstage.annotation import EpisodeLabeller, FrameLabels
from carstage.annotation.schema import CAMERA_OBJECT_COLUMNS, OBJECT_COLUMNS
from carstage.annotation.tracks import FIRST_LEVEL_OBJECT, level_tracks, rider_track
from carstage.rawlog.reader import LevelObject

LIGHT_TAG, SIGN_TAG, POLE_TAG = 7, 8, 6
LIGHT_ACTOR = 40
LEVEL = (0.0, 0.0, 0.0)


def level_object(
    number: int,
    label: int = CAR_TAG,
    *,
    location: tuple[float, float, float] = (20.0, 0.0, 0.0),
    extent: tuple[float, float, float] = CAR_EXTENT,
    light: int = 0,
) -> LevelObject:
    return LevelObject(
        id=number,
        name=f"Object_{number}",
        label=label,
        light=light,
        box_location=np.array(location),
        box_extent=np.array(extent),
        box_rotation_deg=np.zeros(3),
    )


def label(
    *objects: LevelObject,
    stage: PaintedImages | None = None,
    actors: Any = (),
    poses: Any = None,
    lidar: Any = None,
    server: str = "0.9.16",
    meta: Any = None,
    **options: Any,
) -> FrameLabels:
    header = annotation_scenes.header(lidar=lidar is not None, **options)
    known = {info.id: info for info in (actor(EGO_ID), *actors)}
    subject = EpisodeLabeller({**header, "server_version": server}, known, level_objects=objects)
    points = {} if lidar is None else {"TOP": lidar}
    images = {"CAM": (stage or PaintedImages()).images()}
    return subject.label_frame(snapshot(poses or {}, **(meta or {})), 2, images, points)


def static_rows(found: FrameLabels) -> list[dict[str, Any]]:
    return [row for row in found.objects if row["is_static"]]


def painted(*solids: tuple[Any, Any, int]) -> PaintedImages:
    """Solids of the level: middle, half sizes, tag; their pixels carry ids of no actor."""
    stage = PaintedImages()
    for number, (center, extent, tag) in enumerate(solids):
        stage.paint_box(center, extent, 0x8000 + number, tag=tag)
    return stage


def test_a_parked_car_is_labelled_by_depth_and_tag() -> None:
    stage = painted(((20.0, 0.0, 0.0), CAR_EXTENT, CAR_TAG))
    found = label(level_object(5), stage=stage)
    (row,) = static_rows(found)
    assert (row["class"], row["box_source"], row["blueprint"]) == ("car", "level", "Object_5")
    assert row["box_center"] == [20.0, 0.0, 0.0]
    assert row["velocity"] == [0.0, 0.0, 0.0]
    assert row["track_id"] == FIRST_LEVEL_OBJECT + 5
    (seen,) = found.camera_objects
    assert seen["visibility_method"] == "depth"
    assert seen["visible_px"] == np.count_nonzero(stage.bgra[..., 2] == CAR_TAG)
    assert seen["occlusion_ratio"] == 0.0
    assert seen["visible"] is True
    assert set(row) == {column.name for column in OBJECT_COLUMNS}
    assert set(seen) == {column.name for column in CAMERA_OBJECT_COLUMNS}


def test_rows_of_actors_are_the_same_with_and_without_level_objects() -> None:
    car = actor(300)
    stage = PaintedImages()
    stage.paint_box((15.0, 0.0, 0.0), CAR_EXTENT, 300)
    poses = {300: ((15.0, 0.0, 0.0), LEVEL)}
    alone = label(stage=stage, actors=(car,), poses=poses)
    beside = label(
        level_object(1), level_object(2, LIGHT_TAG), stage=stage, actors=(car,), poses=poses
    )
    assert beside.objects[: len(alone.objects)] == alone.objects
    assert beside.camera_objects[: len(alone.camera_objects)] == alone.camera_objects
    assert len(beside.objects) == len(alone.objects) + 2


def test_a_pixel_of_an_actor_with_the_low_bits_of_a_track_is_not_the_level_objects() -> None:
    stage = PaintedImages()
    stage.paint_box((20.0, 0.0, 0.0), CAR_EXTENT, 5, tag=12)  # a pedestrian where the car should be
    (seen,) = label(level_object(5), stage=stage).camera_objects
    assert seen["visible_px"] == 0
    assert seen["instance_ambiguous"] is False


def test_only_objects_within_the_maximum_distance_of_ego_or_camera_have_rows() -> None:
    near, far = level_object(1, POLE_TAG), level_object(2, POLE_TAG, location=(90.0, 0.0, 0.0))
    behind = level_object(3, POLE_TAG, location=(-100.0, 0.0, 0.0))  # 50 m from the ego
    rows = static_rows(label(near, far, behind, max_distance_m=60.0))
    assert [row["blueprint"] for row in rows] == ["Object_1", "Object_3"]
    from_ego = {"distance_origin": "ego"}
    rows = static_rows(label(near, far, behind, max_distance_m=60.0, labels=from_ego))
    assert [row["blueprint"] for row in rows] == ["Object_3"]


def test_a_light_shows_the_state_of_its_actor() -> None:
    head, lone = level_object(1, LIGHT_TAG, light=LIGHT_ACTOR), level_object(2, LIGHT_TAG)
    meta = {"traffic_lights": {str(LIGHT_ACTOR): "Red"}}
    known, unknown = static_rows(label(head, lone, meta=meta))
    assert (known["class"], known["traffic_light_state"]) == ("traffic_light", "Red")
    assert known["parent_track_id"] == LIGHT_ACTOR
    assert (unknown["traffic_light_state"], unknown["parent_track_id"]) == (None, None)


def test_lidar_points_decide_on_parked_cars_but_not_on_signs() -> None:
    stage = painted(
        ((20.0, 0.0, 0.0), CAR_EXTENT, CAR_TAG), ((15.0, -5.0, 1.0), (0.01, 0.4, 0.4), SIGN_TAG)
    )
    objects = (level_object(1), level_object(2, SIGN_TAG, location=(15.0, -5.0, 1.0),
                                             extent=(0.01, 0.4, 0.4)))  # fmt: skip
    nowhere = np.zeros((5, 4), dtype=np.float32)
    car, sign = label(*objects, stage=stage, lidar=nowhere, min_lidar_points=5).camera_objects
    assert car["visible_pixel"] is True
    assert car["visible"] is False
    assert sign["visible"] is True


def test_a_point_in_a_parked_car_is_counted() -> None:
    (row,) = static_rows(label(level_object(1), lidar=np.array([[20.0, 0, 0, 1]], np.float32)))
    assert row["num_lidar_points"] == [("TOP", 1)]


@pytest.mark.parametrize(
    "extent", [(np.nan, 1.0, 1.0), (0.0, 1.0, 1.0), (2.0, 0.01, 0.7), (20.0, 1.0, 1.0)]
)
def test_a_parked_car_whose_box_cannot_be_right_has_no_row(extent) -> None:
    assert static_rows(label(level_object(1, extent=extent))) == []


def test_parked_vehicles_need_labels_of_vehicles() -> None:
    truth = {"vehicles": False, "pedestrians": True, "ego_motion": True}
    found = label(level_object(1), level_object(2, SIGN_TAG), ground_truth=truth)
    assert [row["class"] for row in static_rows(found)] == ["traffic_sign"]


def test_labels_of_old_servers_are_renumbered() -> None:
    stage = painted(((20.0, 0.0, 0.0), CAR_EXTENT, 10))
    car, light = level_object(1, 10), level_object(2, 18)
    found = label(car, light, stage=stage, server="0.9.13")
    assert [row["class"] for row in static_rows(found)] == ["car", "traffic_light"]
    assert [row["semantic_tags"] for row in static_rows(found)] == [[14], [7]]
    assert found.camera_objects[0]["visible_px"] > 0


def test_tracks_of_the_level_are_no_actors_and_stay_exact() -> None:
    hashes = [2**64 - 1, 2**52 + 5, 5, 17]
    tracks = level_tracks(hashes)
    assert len(set(tracks)) == len(hashes)
    assert tracks == level_tracks(hashes)
    assert all(2**52 <= track < 2**53 and float(track) == track for track in tracks)
    assert 2**32 <= rider_track(0) < rider_track(2**32 - 1) < 2**52


BIKE_ID = 300


def bike_stage() -> PaintedImages:
    stage = PaintedImages()
    stage.paint_box((12.0, 0.0, -0.4), (0.8, 0.2, 0.35), BIKE_ID, tag=19)
    stage.paint_box((12.0, 0.0, 0.3), (0.3, 0.25, 0.45), BIKE_ID, tag=RIDER_TAG)
    return stage


def bike_with_rider(server: str = "0.9.16", **options: Any) -> FrameLabels:
    bike = actor(
        BIKE_ID,
        "vehicle.bh.crossbike",
        extent=(0.9, 0.4, 0.8),
        attributes={"base_type": "bicycle", "number_of_wheels": "2"},
    )
    poses = {BIKE_ID: ((12.0, 0.0, 0.0), LEVEL)}
    return label(stage=bike_stage(), actors=(bike,), poses=poses, server=server, **options)


def test_a_rider_has_a_row_by_its_pixels_and_no_3d_box() -> None:
    found = bike_with_rider()
    bike, rider = found.camera_objects
    assert bike["track_id"] == BIKE_ID
    assert rider["track_id"] == rider_track(BIKE_ID)
    assert 0 < rider["visible_px"] < bike["visible_px"]
    rows, columns = np.nonzero(bike_stage().bgra[..., 2] == RIDER_TAG)
    assert rider["visible_px"] == len(rows)
    bounds = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert rider["bbox_modal"] == bounds
    assert rider["visible"] is True
    unknown = ("center_cam", "bbox_amodal", "n_visible", "truncated", "visible_stage_vo")
    assert [rider[name] for name in unknown] == [None] * len(unknown)
    row = next(row for row in found.objects if row["class"] == "rider")
    assert (row["parent_track_id"], row["box_source"]) == (BIKE_ID, "none")
    assert row["box_center"] is None
    assert row["semantic_tags"] == [RIDER_TAG]
    for names, columns in ((rider, CAMERA_OBJECT_COLUMNS), (row, OBJECT_COLUMNS)):
        assert set(names) == {column.name for column in columns}
        assert all(column.nullable for column in columns if names[column.name] is None)


@pytest.mark.parametrize(
    ("server", "options"), [("0.9.13", {}), ("0.9.16", {"labels": {"method": "stage_vo"}})]
)
def test_there_is_no_rider_where_nothing_tells_it_from_its_two_wheeler(server, options) -> None:
    found = bike_with_rider(server, **options)
    assert "rider" not in {row["class"] for row in found.objects}


def test_duplicate_ids_of_a_server_keep_their_rows_apart() -> None:
    twins = [level_object(9), replace(level_object(9), box_location=np.array([30.0, 0.0, 0.0]))]
    rows = static_rows(label(*twins))
    assert len({row["track_id"] for row in rows}) == 2
