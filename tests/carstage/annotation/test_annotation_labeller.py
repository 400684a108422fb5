"""A frame's rows as a whole: which objects, which cameras, which verdicts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from annotation_scenes import (
    CAR_EXTENT,
    EGO_ID,
    RIDER_TAG,
    ROAD_TAG,
    PaintedImages,
    actor,
    box_interval,
    header,
    labeller,
    snapshot,
)
from carstage.annotation import CameraImages, EpisodeLabeller, FrameLabels
from carstage.annotation.pixels import BoxView
from carstage.annotation.schema import (
    CAMERA_OBJECT_COLUMNS,
    EGO_COLUMNS,
    OBJECT_COLUMNS,
    Column,
)
from carstage.errors import AnnotationError
from carstage.geometry import OPTICAL_FROM_SENSOR, intrinsics, rotation_matrix

CAR_ID, WALKER_ID = 300, 301
LEVEL = (0.0, 0.0, 0.0)
AHEAD_LEFT = ((30.0, -10.0, 0.0), LEVEL)
AHEAD = {CAR_ID: ((20.0, 0.0, 0.0), LEVEL)}
SCALARS = {"bool": bool, "str": str, "json": str, "f64": float, "i32": int, "i64": int}
SCALARS |= {"u8": int, "u32": int, "u64": int}


def walker(actor_id: int = WALKER_ID) -> Any:
    return actor(
        actor_id, "walker.pedestrian.0001", extent=(0.3, 0.3, 0.9), attributes={"age": "adult"}
    )


def painted(center: tuple[float, float, float] = (20.0, 0.0, 0.0), **options: Any) -> PaintedImages:
    stage = PaintedImages()
    stage.paint_box(center, CAR_EXTENT, CAR_ID, **options)
    return stage


def label(
    poses: Any = AHEAD,
    stage: PaintedImages | None = None,
    actors: tuple[Any, ...] = (),
    lidar: Any = None,
    **options: Any,
) -> FrameLabels:
    images = (stage or painted()).images()
    subject = labeller(*(actors or (actor(CAR_ID),)), lidar=lidar is not None, **options)
    points = {} if lidar is None else {"TOP": lidar}
    return subject.label_frame(snapshot(poses), 2, {"CAM": images}, points)


def one(found: FrameLabels) -> dict[str, Any]:
    assert len(found.camera_objects) == 1
    return found.camera_objects[0]


def check_row(row: dict[str, Any], columns: tuple[Column, ...]) -> None:
    assert set(row) == {column.name for column in columns}
    for column in columns:
        value = row[column.name]
        if value is None:
            assert column.nullable, column.name
        elif column.type in SCALARS:
            assert type(value) is SCALARS[column.type], (column.name, value)
        elif column.type == "f64[8][2]":
            assert len(value) == 8
            assert all(point is None or len(point) == 2 for point in value)
        elif column.type.startswith("f64["):
            assert len(value) == int(column.type[4:-1])
            assert all(type(part) is float for part in value), column.name
        else:
            assert column.type in ("map[str,u32]", "u8[]")
            assert isinstance(value, list)


def test_rows_hold_exactly_the_columns_of_the_schema() -> None:
    poses = {**AHEAD, WALKER_ID: ((12.0, 3.0, 0.0), LEVEL), 302: ((1.5, 3.0, 0.0), LEVEL)}
    found = label(
        poses,
        actors=(actor(CAR_ID), walker(), actor(302)),
        lidar=np.zeros((5, 4), dtype=np.float32),
    )
    assert len(found.objects) == 4
    assert len(found.camera_objects) == 3
    for row in found.objects:
        check_row(row, OBJECT_COLUMNS)
    for row in found.camera_objects:
        check_row(row, CAMERA_OBJECT_COLUMNS)
    check_row(found.ego, EGO_COLUMNS)


def test_a_free_car_is_labelled_visible_with_its_golden_box() -> None:
    row = one(label())
    assert (row["k"], row["timestamp_s"], row["sensor_id"]) == (2, 0.4, "CAM")
    golden = np.array([605.649718, 332.881356, 674.350282, 387.118644]) / 2
    np.testing.assert_allclose(row["bbox_amodal"], golden, atol=1e-6)
    assert row["truncated"] == 0.0
    assert row["occlusion_ratio"] == 0.0
    assert row["visibility_method"] == "instance"
    assert row["visible"]
    np.testing.assert_allclose(row["center_cam"], [0, 0, 20], atol=1e-12)
    np.testing.assert_allclose(row["location"], [0, 0.75, 20], atol=1e-12)
    np.testing.assert_allclose(row["dimensions"], [1.5, 1.9, 4.6], atol=1e-12)
    assert row["rotation_y"] == pytest.approx(-np.pi / 2)
    x0, y0, x1, y1 = row["bbox_modal"]
    assert (x0, y0, x1, y1) == (np.ceil(golden[0] - 0.5), np.ceil(golden[1] - 0.5), 337.0, 194.0)


def test_truncated_ignores_occluders_and_the_papers_truncation_does_not() -> None:
    center = (20.0, -20.0, 0.0)
    poses = {CAR_ID: (center, LEVEL)}
    free = one(label(poses, PaintedImages()))
    hidden_stage = painted(center)
    hidden_stage.paint(np.ones((360, 640), dtype=np.bool_), 5.0, 0, ROAD_TAG)
    hidden = one(label(poses, hidden_stage))
    assert free["truncated"] == hidden["truncated"] == pytest.approx(0.590337, abs=1e-6)
    assert free["truncation_paper"] == 0.5
    assert hidden["truncation_paper"] == 1.0
    assert hidden["bbox_modal"] is None
    assert hidden["mask_modal"] is None
    assert not hidden["visible"]


@pytest.mark.parametrize("center", [(-20.0, 0.0, 0.0), (20.0, 40.0, 0.0), (90.0, 0.0, 0.0)])
def test_objects_behind_beside_or_too_far_get_no_camera_row_but_an_object_row(
    center: tuple[float, float, float],
) -> None:
    found = label({CAR_ID: (center, LEVEL)})
    assert found.camera_objects == []
    assert [row["track_id"] for row in found.objects] == [EGO_ID, CAR_ID]
    assert found.objects[1]["visibility"] == 0.0
    assert found.objects[1]["visibility_token"] == 1


def test_the_distance_limit_may_count_from_the_ego() -> None:
    near = {"max_distance_m": 60.0}
    assert len(label(**near).camera_objects) == 1
    assert label(labels={"distance_origin": "ego"}, **near).camera_objects == []


def test_the_ego_is_an_object_but_never_a_camera_row() -> None:
    """Here the camera looks back at its own car from 20 m behind."""
    found = label({EGO_ID: ((20.0, 0.0, 0.0), LEVEL), CAR_ID: AHEAD_LEFT}, mount={"x_m": -20.0})
    assert [row["is_ego"] for row in found.objects] == [True, False]
    assert [row["track_id"] for row in found.camera_objects] == [CAR_ID]


def test_rider_pixels_belong_to_the_two_wheeler() -> None:
    bike = actor(
        CAR_ID,
        "vehicle.bh.crossbike",
        extent=(0.9, 0.4, 0.8),
        attributes={"base_type": "bicycle", "number_of_wheels": "2"},
    )
    stage = PaintedImages()
    stage.paint_box((12.0, 0.0, -0.4), (0.8, 0.2, 0.35), CAR_ID, tag=19)
    below = one(label({CAR_ID: ((12.0, 0.0, 0.0), LEVEL)}, stage, (bike,)))["visible_px"]
    stage.paint_box((12.0, 0.0, 0.3), (0.3, 0.25, 0.45), CAR_ID, tag=RIDER_TAG)
    both, _ = label({CAR_ID: ((12.0, 0.0, 0.0), LEVEL)}, stage, (bike,)).camera_objects
    assert both["visible_px"] > below > 0
    assert both["bbox_modal"][1] < 180.0 - 0.5 * 320 / 12


def test_a_two_wheeler_with_an_unusable_box_gets_no_3d_label() -> None:
    bike = actor(
        CAR_ID, "vehicle.bh.crossbike", extent=(np.inf, 0, 0.7), attributes={"base_type": "bicycle"}
    )
    found = label(actors=(bike,), lidar=np.zeros((5, 4), dtype=np.float32))
    assert found.camera_objects == []
    row = found.objects[1]
    assert row["box_source"] == "invalid"
    assert row["box_center"] is None
    assert row["box_extent"] is None
    assert row["num_lidar_points"] == []
    check_row(row, OBJECT_COLUMNS)


@pytest.mark.parametrize(
    ("switches", "expected"),
    [
        ({"vehicles": True, "pedestrians": False}, [EGO_ID, CAR_ID]),
        ({"vehicles": False, "pedestrians": True}, [WALKER_ID]),
        ({"vehicles": False, "pedestrians": False}, []),
    ],
)
def test_ground_truth_switches_decide_what_is_written(
    switches: dict[str, bool], expected: list[int]
) -> None:
    poses = {**AHEAD, WALKER_ID: ((12.0, 3.0, 0.0), LEVEL)}
    found = label(
        poses,
        actors=(actor(CAR_ID), walker()),
        ground_truth={**switches, "ego_motion": False},
        lidar=np.zeros((5, 4), dtype=np.float32),
    )
    assert [row["track_id"] for row in found.objects] == expected
    assert {row["track_id"] for row in found.camera_objects} <= set(expected)
    assert found.ego == {}


def test_detections_of_a_radar_are_counted_in_each_box() -> None:
    subject = labeller(actor(CAR_ID), lidar=True)
    detections = np.array([[20.0, 0.0, 0.0], [20.5, 0.5, 0.2], [20.0, 9.0, 0.0]])
    nothing = {"TOP": np.zeros((0, 4), dtype=np.float32)}
    found = subject.label_frame(snapshot(AHEAD), 2, {}, nothing, {"RADAR": detections})
    assert found.objects[1]["num_radar_points"] == [("RADAR", 2)]
    assert found.objects[1]["num_lidar_points"] == [("TOP", 0)]
    missed = subject.label_frame(snapshot(AHEAD), 2, {}, nothing)
    assert missed.objects[1]["num_radar_points"] == []


def test_few_lidar_points_make_an_object_invisible_where_the_rig_has_a_lidar() -> None:
    inside = np.array([[20.0, 0.0, 0.0, 1.0]] * 4, dtype=np.float32)
    found = label(lidar=inside, min_lidar_points=5)
    assert found.objects[1]["num_lidar_points"] == [("TOP", 4)]
    assert not one(found)["visible"]
    assert one(found)["visible_pixel"]
    assert one(label(lidar=inside, min_lidar_points=4))["visible"]
    assert one(label(min_lidar_points=5))["visible"]


def test_the_method_decides_the_verdict() -> None:
    """Only the vertices are seen past a wall with a hole at each of them, or all but them."""
    corners_hidden = painted()
    for u in (302, 306, 333, 337):
        for v in (166, 169, 190, 193):
            corners_hidden.depth[v - 2 : v + 3, u - 3 : u + 4] = 4.0
    paper = one(label(stage=corners_hidden, labels={"method": "stage_vo"}))
    pixels = one(label(stage=corners_hidden, labels={"method": "pixels"}))
    both = one(label(stage=corners_hidden))
    assert not paper["visible"]
    assert paper["visible_px"] is None
    assert paper["visibility_method"] == "none"
    assert pixels["visible"]
    assert both["visible"]
    assert (both["visible_stage_vo"], both["visible_pixel"]) == (False, True)


def test_the_paper_method_needs_no_instance_images() -> None:
    assert labeller(labels={"method": "stage_vo"}).inputs("CAM").instance is None
    assert labeller().inputs("CAM").instance == "CAM.instance"
    assert labeller().inputs("CAM").depth == "CAM.depth"
    found = label(labels={"method": "stage_vo"})
    assert found.objects[1]["visibility"] is None


def test_without_instance_images_depth_decides() -> None:
    depth_only = CameraImages(painted().images().depth_m)
    subject = labeller(actor(CAR_ID))
    row = one(subject.label_frame(snapshot(AHEAD), 0, {"CAM": depth_only}, {}))
    assert row["visibility_method"] == "depth"
    # Only tags can tell the car's lowest 5 cm from the road.
    assert 0.9 < row["visible_px"] / one(label())["visible_px"] < 1.0


def test_servers_before_0_9_16_are_labelled_by_depth_and_tag() -> None:
    """Their instance ids are not actor ids; a wrong match would hide every object."""
    stage = painted()
    stage.bgra[..., :2] = 99
    known = {EGO_ID: actor(EGO_ID), CAR_ID: actor(CAR_ID)}
    old = EpisodeLabeller({**header(), "server_version": "0.9.15"}, known)
    row = one(old.label_frame(snapshot(AHEAD), 0, {"CAM": stage.images()}, {}))
    assert row["visibility_method"] == "depth"
    assert row["visible"]


def test_box_settings_decide_which_boxes_are_written() -> None:
    flat = label(labels={"boxes": ["2d"]})
    assert flat.objects[1]["box_center"] is None
    assert one(flat)["rotation_y"] is None
    assert one(flat)["bbox_amodal"] is not None
    solid = label(labels={"boxes": ["3d"]})
    assert one(solid)["bbox_amodal"] is None
    assert one(solid)["mask_modal"] is None
    assert one(solid)["rotation_y"] is not None


def test_a_missing_camera_gets_no_rows_and_the_others_theirs() -> None:
    subject = labeller(actor(CAR_ID), cameras=("LEFT", "RIGHT"))
    assert subject.labelled_cameras == ("LEFT", "RIGHT")
    found = subject.label_frame(snapshot(AHEAD), 0, {"RIGHT": painted().images()}, {})
    assert [row["sensor_id"] for row in found.camera_objects] == ["RIGHT"]


def test_a_distorted_camera_projects_no_boxes() -> None:
    head = header()
    head["spec"]["sensors"][0]["attributes"]["lens_k"] = "-0.5"
    subject = EpisodeLabeller(head, {EGO_ID: actor(EGO_ID), CAR_ID: actor(CAR_ID)})
    images = {"CAM": painted().images()}
    assert subject.label_frame(snapshot(AHEAD), 0, images, {}).camera_objects == []


def test_angular_velocity_is_converted_to_radians_and_null_for_walkers() -> None:
    poses = {**AHEAD, WALKER_ID: ((12.0, 3.0, 0.0), LEVEL)}
    found = label(poses, actors=(actor(CAR_ID), walker()))
    car, person = found.objects[1], found.objects[2]
    np.testing.assert_allclose(car["angular_velocity"], [0, 0, 1.0], atol=1e-7)
    assert person["angular_velocity"] is None
    assert found.ego["yaw_rate"] == pytest.approx(1.0, abs=1e-7)
    assert found.ego["yaw_rate_flu"] == -found.ego["yaw_rate"]


def test_in_asynchronous_mode_the_servers_clock_counts() -> None:
    found = label(timing={"mode": "async"})
    times = [row["timestamp_s"] for row in (*found.objects, one(found), found.ego)]
    assert times == [0.75] * 4  # 3.0 s on the clock, 2.25 s at the first frame


def test_a_header_without_times_is_refused() -> None:
    head = header(timing={"mode": "async"})
    del head["first_timestamp_s"]
    with pytest.raises(AnnotationError, match="first_timestamp_s"):
        EpisodeLabeller(head, {})


def test_an_oncoming_car_has_the_half_open_yaw() -> None:
    found = label({CAR_ID: ((20.0, 0.0, 0.0), (0.0, 180.0, 0.0))})
    assert found.objects[1]["box_yaw_ego"] == -np.pi


def test_vectors_of_the_ego_frame_turn_with_the_ego() -> None:
    found = label({EGO_ID: ((0.0, 0.0, 0.0), (0.0, 90.0, 0.0)), **AHEAD})
    car = found.objects[1]
    np.testing.assert_allclose(car["box_center_ego"], [0.0, -20.0, 0.0], atol=1e-12)
    assert car["box_yaw_ego"] == pytest.approx(-np.pi / 2)
    np.testing.assert_allclose(car["velocity_ego"], [2.0, -1.0, 0.0], atol=1e-12)
    assert car["distance_ego"] == pytest.approx(20.0)
    np.testing.assert_allclose(found.ego["velocity_ego"], [2.0, -1.0, 0.0], atol=1e-12)


def test_the_first_acceleration_is_null_without_warm_up() -> None:
    subject = labeller(actor(CAR_ID), warmup_ticks=0)
    first = subject.label_frame(snapshot(AHEAD, tick=0), 0, {}, {})
    later = subject.label_frame(snapshot(AHEAD, tick=1), 1, {}, {})
    assert first.ego["acceleration"] is None
    assert first.objects[0]["acceleration_ego"] is None
    assert later.ego["acceleration"] == [0.5, 0.0, 0.0]


def test_the_ego_row_turns_vectors_and_places_the_pivot_on_the_earth() -> None:
    subject = labeller(actor(CAR_ID))
    world = snapshot({EGO_ID: ((100.0, -100.0, 2.0), (90.0, 0.0, 0.0))})
    ego = subject.label_frame(world, 0, {}, {}).ego
    # Nose up: forward is the world's up, up is the world's backwards.
    np.testing.assert_allclose(ego["acceleration_ego"], [0.0, 0.0, -0.5], atol=1e-12)
    np.testing.assert_allclose(ego["angular_velocity_ego"], [1.0, 0.0, 0.0], atol=1e-7)
    assert ego["speed"] == pytest.approx(np.sqrt(5.0))
    assert ego["latitude_deg"] == pytest.approx(0.000898315284, abs=1e-11)
    assert ego["longitude_deg"] == pytest.approx(0.000898315284, abs=1e-11)
    assert ego["altitude_m"] == 2.0


def test_the_box_stands_where_the_actor_carries_it() -> None:
    offset = actor(CAR_ID, location=(0.5, 0.0, 0.75))
    found = label({CAR_ID: ((20.0, 0.0, 0.0), (0.0, 90.0, 0.0))}, actors=(offset,))
    np.testing.assert_allclose(found.objects[1]["box_center"], [20.0, 0.5, 0.75], atol=1e-12)
    np.testing.assert_allclose(one(found)["center_cam"], [0.5, -0.75, 20.0], atol=1e-12)
    assert found.objects[1]["actor_location"] == [20.0, 0.0, 0.0]


def test_sensor_poses_come_from_the_snapshot_of_the_frame() -> None:
    camera = 400
    rig = actor(camera, "sensor.camera.rgb")
    poses = {**AHEAD, camera: ((20.0, -10.0, 1.0), (0.0, 90.0, 0.0))}
    row = one(label(poses, actors=(actor(CAR_ID), rig), sensor_actor_ids={"CAM": camera}))
    np.testing.assert_allclose(row["center_cam"], [0.0, 1.0, 10.0], atol=1e-9)


def test_sensors_are_where_they_are_when_no_object_is_labelled() -> None:
    poses = {CAR_ID: AHEAD[CAR_ID], EGO_ID: ((3.0, -4.0, 0.5), (5.0, 120.0, -2.0))}
    nobody = {"vehicles": False, "pedestrians": False, "ego_motion": True}
    found, usual = label(poses, ground_truth=nobody), label(poses)
    assert found.objects == found.camera_objects == []
    assert found.sensor_poses == usual.sensor_poses
    assert found.ego == usual.ego


def test_a_sensor_missing_from_the_snapshot_stands_on_its_mount() -> None:
    """A camera that looks 10 degrees down sees what is ahead above its centre."""
    mount = {"x_m": 50.0, "z_m": 2.0, "pitch_deg": -10.0}
    row = one(label(mount=mount, sensor_actor_ids={"CAM": 400}))
    c, s = np.cos(np.radians(10.0)), np.sin(np.radians(10.0))
    np.testing.assert_allclose(row["center_cam"], [0.0, 2 * c - 20 * s, 20 * c + 2 * s], atol=1e-9)


def test_visibility_sums_the_pixels_of_all_cameras() -> None:
    hidden_stage = painted()
    hidden_stage.paint(np.ones((360, 640), dtype=np.bool_), 5.0, 0, ROAD_TAG)
    subject = labeller(actor(CAR_ID), cameras=("A", "B", "C"))
    images = {"A": painted().images(), "B": hidden_stage.images(), "C": painted().images()}
    found = subject.label_frame(snapshot(AHEAD), 0, images, {})
    free, hidden, _ = found.camera_objects
    expected = 2 * free["visible_px"] / (2 * free["amodal_px"] + hidden["amodal_px"])
    assert found.objects[1]["visibility"] == pytest.approx(expected)
    assert found.objects[1]["visibility_token"] == 3


def test_where_no_labelled_camera_looks_visibility_is_unknown() -> None:
    rows = labeller(actor(CAR_ID)).label_frame(snapshot(AHEAD), 2, {}, {}).objects
    assert [(row["visibility"], row["visibility_token"]) for row in rows] == [(None, None)] * 2
    away = label({CAR_ID: ((-20.0, 0.0, 0.0), LEVEL)}).objects
    assert [(row["visibility"], row["visibility_token"]) for row in away] == [(0.0, 1)] * 2


def test_ids_above_16_bits_are_found_by_their_low_bits() -> None:
    high = CAR_ID + 65536
    row = one(label({high: ((20.0, 0.0, 0.0), LEVEL)}, actors=(actor(high),)))
    assert row["track_id"] == high
    assert row["visible_px"] == one(label())["visible_px"]


def test_the_silhouette_is_counted_to_its_last_pixel() -> None:
    """Counting in the bounding rectangle must find what counting everywhere finds."""
    tilted = (3.0, 33.0, -4.0)
    row = one(label({CAR_ID: ((9.0, 1.0, 0.3), tilted)}))
    rotation = rotation_matrix(tilted)
    everywhere = BoxView(
        origin_box=rotation.T @ -np.array([9.0, 1.0, 0.3]),
        box_from_optical=rotation.T @ OPTICAL_FROM_SENSOR.T,
        extent_m=np.array(CAR_EXTENT),
        ground_m=-CAR_EXTENT[2],
        region=(0, 0, 640, 360),
    )
    enter, leave = box_interval(everywhere, intrinsics(640, 360, 90.0))
    assert row["hull_px"] == np.count_nonzero(enter <= leave)


def test_the_road_is_where_a_vehicle_stands_though_its_box_reaches_into_it() -> None:
    """As boxes of some of CARLA's cars do; by depth alone the road within is not the car."""
    sunk = actor(CAR_ID, location=(0.0, 0.0, 0.68))
    stage = PaintedImages()
    road_z = -1.5
    with np.errstate(divide="ignore"):
        road = np.where(stage.rays[..., 2] < 0.0, road_z / stage.rays[..., 2], 1e9)
    stage.paint(road < 1e8, road, 0, ROAD_TAG)
    subject = labeller(sunk)
    world = snapshot({CAR_ID: ((8.0, 2.0, road_z), LEVEL)})
    images = {"CAM": CameraImages(stage.images().depth_m)}
    assert one(subject.label_frame(world, 0, images, {}))["visible_px"] == 0
    stage.paint_box((8.0, 2.0, road_z + 0.9), (2.0, 0.8, 0.5), CAR_ID)
    images = {"CAM": CameraImages(stage.images().depth_m)}
    row = one(subject.label_frame(world, 0, images, {}))
    painted = np.argwhere(stage.bgra[..., 2] == 14)
    (top, left), (bottom, right) = painted.min(axis=0), painted.max(axis=0) + 1
    assert row["bbox_modal"] == [left, top, right, bottom]


def test_meta_of_the_snapshot_reaches_the_rows() -> None:
    meta = {
        "ego": {"throttle": 0.5, "gear": 2, "reverse": False, "traffic_light_state": "Green"},
        "weather": {"wetness": 1.0, "cloudiness": 5.0},
        "vehicle_lights": {str(CAR_ID): 3},
    }
    subject = labeller(actor(CAR_ID))
    found = subject.label_frame(snapshot(AHEAD, **meta), 0, {}, {})
    assert (found.ego["throttle"], found.ego["gear"], found.ego["brake"]) == (0.5, 2, None)
    assert found.ego["traffic_light_state"] == "Green"
    assert found.ego["weather"] == '{"cloudiness":5.0,"wetness":1.0}'
    assert [row["light_state"] for row in found.objects] == [None, 3]


def test_shared_low_ids_are_flagged() -> None:
    poses = {**AHEAD, CAR_ID + 65536: ((-30.0, 0.0, 0.0), LEVEL)}
    row = one(label(poses, actors=(actor(CAR_ID), actor(CAR_ID + 65536))))
    assert row["instance_ambiguous"]
    assert not one(label())["instance_ambiguous"]


def test_an_actor_without_a_table_entry_is_an_error() -> None:
    with pytest.raises(AnnotationError, match="Actor 301"):
        label({**AHEAD, WALKER_ID: ((12.0, 3.0, 0.0), LEVEL)})


def test_a_snapshot_without_the_ego_is_an_error() -> None:
    known = {CAR_ID: actor(CAR_ID)}
    subject = EpisodeLabeller({**header(), "ego_id": 999}, known)
    with pytest.raises(AnnotationError, match="999"):
        subject.label_frame(snapshot(AHEAD), 0, {}, {})


def test_an_image_of_the_wrong_size_is_an_error() -> None:
    with pytest.raises(AnnotationError, match="shape"):
        label(stage=PaintedImages(320, 180))


@pytest.mark.parametrize("labels", [{"method": "guess"}, {"distance_origin": "moon"}])
def test_unknown_settings_are_refused(labels: dict[str, str]) -> None:
    with pytest.raises(AnnotationError, match=r"spec\.labels"):
        labeller(labels=labels)


def test_an_incomplete_header_is_refused() -> None:
    head = header()
    del head["geo_reference"]
    with pytest.raises(AnnotationError, match="geo_reference"):
        EpisodeLabeller(head, {})


def test_a_labelled_camera_without_a_depth_twin_is_refused() -> None:
    head = header()
    head["spec"]["sensors"][0]["depth"] = None
    with pytest.raises(AnnotationError, match="CAM"):
        EpisodeLabeller(head, {})
