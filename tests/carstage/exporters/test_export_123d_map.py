"""Maps of 123D exports, opened by py123d's own map API."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import small_maps
from analytic_dataset import (
    SIZE,
    add_episode,
    add_vector_map,
    attempt_of,
    give_vector_map,
    make_dataset,
)
from carstage.dataset import Episode
from carstage.exporters import export_dataset
from carstage.exporters.formats.map_123d import _groups, _left_to_right
from carstage.vector_map import VectorMap, vector_map
from carstage.vector_map.model import DRIVEN_TYPES
from carstage_sim.maps.writer import PLANS, opendrive_of

pytest.importorskip("py123d", reason="py123d is not installed")

from py123d.api import SceneFilter
from py123d.api.scene.arrow.arrow_scene_builder import ArrowSceneBuilder
from py123d.common.execution import SequentialExecutor
from py123d.datatypes.map_objects.map_layer_types import MapLayer, RoadLineType
from py123d.geometry import Point2D

pytestmark = pytest.mark.xdist_group("export")
ENU = np.array([1.0, -1.0, 1.0])


def scene_of(folder: Path) -> Any:
    builder = ArrowSceneBuilder(folder / "logs", folder / "maps")
    (scene,) = builder.get_scenes(SceneFilter(), SequentialExecutor())
    return scene


@pytest.fixture(scope="module")
def text() -> str:
    return opendrive_of(PLANS["Stage01"])


@pytest.fixture(scope="module")
def town(text: str) -> VectorMap:
    return vector_map(text)


@pytest.fixture(scope="module")
def exported(text: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("map")
    make_dataset(folder / "in", folder, size=SIZE, steps=2)
    add_vector_map(folder / "in", text)
    export_dataset("123d", folder / "in", folder / "out", workers=0)
    return folder / "out"


@pytest.fixture(scope="module")
def api(exported: Path) -> Any:
    return scene_of(exported).get_map_api()


def objects(api: Any, layer: MapLayer) -> list[Any]:
    return list(api.get_all_map_objects_in_layer(layer))


def test_a_town_s_map_is_that_of_its_logs(exported: Path, api: Any) -> None:
    assert (exported / "maps/carstage/carstage_Analytic01.arrow").is_file()
    about = scene_of(exported).get_map_metadata()
    assert (about.dataset, about.location) == ("carstage", "Analytic01")
    assert about.map_has_z
    assert not about.map_is_per_log
    assert api.get_map_metadata().location == "Analytic01"


def test_lanes_are_those_of_the_town_in_east_north_up(api: Any, town: VectorMap) -> None:
    driven = [lane for lane in town.lanes if lane.type in DRIVEN_TYPES]
    lanes = [lane for lane in objects(api, MapLayer.LANE) if lane.lane_type.name != "BIKE_LANE"]
    assert len(lanes) == len(driven) > 50
    centres = {np.round(lane.centre_line[0] * ENU, 6).tobytes(): lane for lane in driven}
    for lane in lanes[:60]:
        array = lane.centerline.array
        left, right = lane.left_boundary.array, lane.right_boundary.array
        along = array[1, :2] - array[0, :2]
        for side, sign in ((left, 1.0), (right, -1.0)):
            across = side[0, :2] - array[0, :2]
            assert sign * (along[0] * across[1] - along[1] * across[0]) > 0.0
        assert np.round(array[0], 6).tobytes() in centres


def test_lanes_lead_to_where_the_next_begins(api: Any) -> None:
    met = 0
    for lane in objects(api, MapLayer.LANE):
        for after in lane.successors:
            gap = np.linalg.norm(after.centerline.array[0, :2] - lane.centerline.array[-1, :2])
            assert gap < 0.5
            assert lane.object_id in after.predecessor_ids
            met += 1
    assert met > 50


def test_neighbours_and_groups_are_of_one_direction(api: Any) -> None:
    beside = 0
    for group in objects(api, MapLayer.LANE_GROUP):
        lanes = group.lanes
        assert [lane.object_id for lane in lanes] == list(group.lane_ids)
        for left, right in pairwise(lanes):
            gap = np.abs(left.right_boundary.array[0] - right.left_boundary.array[0]).max()
            if gap < 1e-6:
                assert left.right_lane_id == right.object_id
                assert right.left_lane_id == left.object_id
                beside += 1
        for lane in lanes:
            assert lane.lane_group_id == group.object_id
    assert beside > 5


def test_places_are_found_in_their_lanes(api: Any) -> None:
    for lane in objects(api, MapLayer.LANE)[::7]:
        x, y, _ = lane.centerline.array[len(lane.centerline.array) // 2]
        found = api.query(shapely.Point(x, y), [MapLayer.LANE], predicate="intersects")
        assert lane.object_id in {one.object_id for one in found[MapLayer.LANE]}
    nothing = api.get_map_objects_in_radius(Point2D(1e5, 1e5), 1.0, [MapLayer.LANE])
    assert not nothing[MapLayer.LANE]


def test_areas_and_lines_are_all_there(api: Any, town: VectorMap) -> None:
    types = Counter(lane.type for lane in town.lanes)
    assert len(objects(api, MapLayer.CROSSWALK)) == len(town.crosswalks) > 0
    assert len(objects(api, MapLayer.WALKWAY)) == types["sidewalk"] + types["walking"] > 0
    meeting = [one for one in town.junctions if one.outline is not None]
    intersections = objects(api, MapLayer.INTERSECTION)
    assert len(intersections) == len(meeting) > 0
    assert all(one.lane_group_ids for one in intersections)
    painted = [m for m in town.markings if m.type not in ("none", "grass", "curb")]
    lines = objects(api, MapLayer.ROAD_LINE)
    assert len(lines) == len(painted)
    of_white = sum(m.type == "broken" and m.colour == "white" for m in painted)
    assert of_white == sum(one.road_line_type == RoadLineType.DASHED_WHITE for one in lines) > 0
    curbs = sum(m.type == "curb" for m in town.markings)
    assert len(objects(api, MapLayer.ROAD_EDGE)) == curbs


def test_another_map_of_the_same_name_lies_with_its_log(text: str, tmp_path: Path) -> None:
    dataset, out = tmp_path / "in", tmp_path / "out"
    make_dataset(dataset, tmp_path, size=SIZE, steps=2)
    add_vector_map(dataset, text)
    first = attempt_of(dataset)
    add_episode(dataset, tmp_path, "fedcba9876543210", 2)
    (other,) = (one for one in dataset.glob("episodes/*/*") if one != first)
    road = small_maps.document(small_maps.road(1, 0.0, 0.0, 0.0, 100.0))
    give_vector_map(dataset, other, road)
    export_dataset("123d", dataset, out, workers=0)
    builder = ArrowSceneBuilder(out / "logs", out / "maps")
    lanes = {
        scene.get_log_metadata().log_name: len(objects(scene.get_map_api(), MapLayer.LANE))
        for scene in builder.get_scenes(SceneFilter(), SequentialExecutor())
    }
    assert lanes[first.parent.name] > 50
    assert lanes[other.parent.name] == len(vector_map(road).lanes) > 0
    assert [one.parent.name for one in out.rglob("map.arrow")] == [other.parent.name]


def test_a_town_s_map_is_read_once_for_all_its_episodes(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = tmp_path / "in"
    make_dataset(dataset, tmp_path, size=SIZE, steps=2)
    add_vector_map(dataset, text)
    first = attempt_of(dataset)
    add_episode(dataset, tmp_path, "fedcba9876543210", 2)
    (other,) = (one for one in dataset.glob("episodes/*/*") if one != first)
    give_vector_map(dataset, other, text)
    read, calls = Episode.vector_map, []
    monkeypatch.setattr(Episode, "vector_map", lambda own: (calls.append(own.id), read(own))[1])
    export_dataset("123d", dataset, tmp_path / "out", workers=0)
    assert calls == [first.parent.name] * 2  # examined, and written
    builder = ArrowSceneBuilder(tmp_path / "out/logs", tmp_path / "out/maps")
    for scene in builder.get_scenes(SceneFilter(), SequentialExecutor()):
        assert len(objects(scene.get_map_api(), MapLayer.LANE)) > 50


def test_lanes_of_a_group_go_from_left_to_right_in_whatever_order_they_come(
    town: VectorMap,
) -> None:
    met = 0
    for group in _groups([lane for lane in town.lanes if lane.type in DRIVEN_TYPES]):
        ordered = _left_to_right(group)
        assert ordered == _left_to_right(group[::-1])
        for left, right in pairwise(ordered):
            along = left.centre_line[1] - left.centre_line[0]
            across = right.centre_line[0] - left.centre_line[0]
            assert along[0] * across[1] - along[1] * across[0] > 0.0  # y is to the right
            met += 1
    assert met > 5


def test_a_log_without_a_vector_map_has_none(tmp_path: Path) -> None:
    make_dataset(tmp_path / "in", tmp_path, size=SIZE, steps=2)
    export_dataset("123d", tmp_path / "in", tmp_path / "out", workers=0)
    assert scene_of(tmp_path / "out").get_map_metadata() is None
    assert not (tmp_path / "out/maps").exists()
