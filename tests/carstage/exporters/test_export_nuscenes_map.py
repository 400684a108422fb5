"""Map expansions in nuscenes-devkit's map API, beside CARLA's client and the recorded drive."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import carla
import numpy as np
import pytest
import shapely

import analytic_scene
import small_maps
from analytic_dataset import (
    SIZE,
    add_episode,
    add_vector_map,
    give_vector_map,
    make_dataset,
)
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.exporters.formats.nuscenes_arcs import TOLERANCE_M, arcline_paths
from carstage.exporters.formats.nuscenes_expansion import LOCATIONS, map_expansion
from carstage.exporters.formats.nuscenes_grounds import grounds_of, town_names
from carstage.vector_map import vector_map
from carstage_sim.maps.writer import PLANS, opendrive_of
from devkits import NUSCENES_VERSION, nuscenes_map_api

pytestmark = pytest.mark.xdist_group("export")

TOWN = "Stage01"
SHIFT_M, SIZE_M = (600.0, 600.0), (1200.0, 1200.0)


@pytest.fixture(scope="module")
def map_api() -> Any:
    return nuscenes_map_api()


@pytest.fixture(scope="module")
def text() -> str:
    return opendrive_of(PLANS[TOWN])


@pytest.fixture(scope="module")
def loaded(text, map_api, tmp_path_factory) -> Any:
    folder = tmp_path_factory.mktemp("town")
    write(folder, "boston-seaport", map_expansion(vector_map(text), TOWN, SHIFT_M, SIZE_M))
    return map_api.NuScenesMap(str(folder), "boston-seaport")


@pytest.fixture(scope="module")
def town_drive(tmp_path_factory) -> Path:
    """The analytic drive, on a road of the drive's own direction."""
    heading = np.radians(-8.0)
    right = 1.75 * np.array([np.sin(heading), -np.cos(heading)])
    begin = -40.0 * np.array([np.cos(heading), np.sin(heading)]) - right
    text = small_maps.document(
        small_maps.road(
            1, *begin, heading, 100.0,
            lanes=(("driving", 3.5), ("sidewalk", 2.0)),
            objects='<object id="7" type="crosswalk" name="walk" s="60" t="0" length="3" '
            'width="7" hdg="0"/>',
            signals=small_maps.light(9, 57.0, (-1, -1)),
        )
    )  # fmt: skip
    work = tmp_path_factory.mktemp("raw")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analytic_scene, "OPENDRIVE", text)
        folder = make_dataset(tmp_path_factory.mktemp("town_drive") / "out", work, size=SIZE)
    add_vector_map(folder, text)
    return folder


def write(folder: Path, location: str, document: dict[str, Any]) -> None:
    (folder / "maps/expansion").mkdir(parents=True)
    (folder / f"maps/expansion/{location}.json").write_text(json.dumps(document))


def waypoints(text: str, every: int) -> Iterator[tuple[Any, np.ndarray]]:
    """Some of the client's waypoints on driving lanes, and where they are on nuScenes's map.

    None is at the end of a lane, which is on no layer: it is the edge of two.
    """
    client = carla.Map(TOWN, text)
    found = [
        w
        for w in client.generate_waypoints(8.0)
        if all(client.get_waypoint_xodr(w.road_id, w.lane_id, w.s + step) for step in (-0.5, 0.5))
    ]
    for waypoint in found[::every]:
        at = waypoint.transform.location
        yield waypoint, np.array([at.x, -at.y]) + SHIFT_M


def test_the_client_s_lanes_are_on_the_layers(loaded, text) -> None:
    on_roads = in_junctions = 0
    for waypoint, (x, y) in waypoints(text, 25):
        layers = loaded.layers_on_point(x, y)
        assert layers["drivable_area"]
        assert layers["road_segment"]
        segment = loaded.get("road_segment", layers["road_segment"])
        assert segment["is_intersection"] == waypoint.is_junction
        if waypoint.is_junction:
            in_junctions += 1
            continue
        on_roads += 1
        assert layers["lane"]
        assert layers["road_block"]
        lane = loaded.extract_polygon(loaded.get("lane", layers["lane"])["polygon_token"])
        ring = np.array(lane.exterior.coords)
        across = np.abs((ring - [x, y]) @ right_of(waypoint))
        assert across[np.linalg.norm(ring - [x, y], axis=1).argmin()] < waypoint.lane_width
    assert on_roads > 10
    assert in_junctions > 3


def right_of(waypoint: Any) -> np.ndarray:
    right = waypoint.transform.get_right_vector()
    return np.array([right.x, -right.y])


def test_lanes_run_through_the_client_s_waypoints_as_they_do(loaded, text) -> None:
    for waypoint, (x, y) in waypoints(text, 40):
        near = loaded.get_records_in_radius(x, y, 2.0, ["lane", "lane_connector"])
        names = [*near["lane"], *near["lane_connector"]]
        poses = np.concatenate([*map(np.array, loaded.discretize_lanes(names, 0.05).values())])
        ahead = waypoint.transform.get_forward_vector()
        turn = poses[:, 2] - np.arctan2(-ahead.y, ahead.x)
        along = np.abs((turn + np.pi) % (2 * np.pi) - np.pi) < np.radians(2.0)
        assert np.linalg.norm(poses[along, :2] - [x, y], axis=1).min() < 0.06
        if not waypoint.is_junction:
            assert loaded.get_closest_lane(x, y) == loaded.record_on_point(x, y, "lane")


def test_a_lane_ends_where_those_that_it_leads_to_begin(loaded) -> None:
    compared = 0
    for name, ways in loaded.connectivity.items():
        end = loaded.get_arcline_path(name)[-1]["end_pose"]
        for other in ways["outgoing"]:
            assert name in loaded.get_incoming_lane_ids(other)
            begin = loaded.get_arcline_path(other)[0]["start_pose"]
            np.testing.assert_allclose(end[:2], begin[:2], atol=0.05)
            compared += 1
    assert compared > 50


def test_the_next_road_of_a_lane_is_the_junction_that_it_leads_to(loaded) -> None:
    followed = 0
    for lane in loaded.lane:
        ways = loaded.get_outgoing_lane_ids(lane["token"])
        if not ways:
            continue
        x, y, _ = loaded.discretize_lanes([lane["token"]], 1.0)[lane["token"]][-2]
        following = loaded.get_next_roads(x, y)["road_segment"]
        (junction,) = (
            name for name in following if loaded.get("road_segment", name)["is_intersection"]
        )
        area = loaded.extract_polygon(loaded.get("road_segment", junction)["polygon_token"])
        for way in ways:
            middle = loaded.discretize_lanes([way], 1.0)[way]
            assert area.covers(shapely.Point(middle[len(middle) // 2][:2]))
        followed += 1
    assert followed > 10


def test_sidewalks_crossings_stop_lines_and_lights_are_there(loaded, text) -> None:
    town = vector_map(text)
    assert len(loaded.ped_crossing) == len(town.crosswalks) > 0
    assert len(loaded.stop_line) == len(town.stop_lines) > 0
    lights = [signal for signal in town.signals if signal.type == "1000001"]
    assert len(loaded.traffic_light) == len(lights) > 0
    for stop in loaded.stop_line:
        assert stop["stop_line_type"] != "TRAFFIC_LIGHT" or stop["cue"]
    client, walked = carla.Map(TOWN, text), 0
    for waypoint, _ in waypoints(text, 40):
        beside = client.get_waypoint(waypoint.transform.location, lane_type=carla.LaneType.Sidewalk)
        if beside is not None and beside.lane_width > 1.0:
            at = beside.transform.location
            assert loaded.record_on_point(at.x + SHIFT_M[0], SHIFT_M[1] - at.y, "walkway")
            walked += 1
    assert walked > 3


def test_a_light_points_at_those_who_wait_for_it(loaded, text) -> None:
    client = carla.Map(TOWN, text)
    by_id = {mark.id: mark for mark in client.get_all_landmarks_of_type("1000001")}
    names = {
        signal.id: loaded.get("traffic_light", name)
        for signal in vector_map(text).signals
        for name in [signal_token(signal.id)]
        if name in loaded._token2ind["traffic_light"]
    }
    assert names
    for name, light in names.items():
        begin, end = (loaded.get("node", one) for one in light["node_tokens"])
        arrow = np.array([end["x"] - begin["x"], end["y"] - begin["y"]])
        # The client's landmark is on the lane that it stops, which runs towards the light.
        lanes = by_id[name].get_lane_validities()
        waypoint = client.get_waypoint_xodr(by_id[name].road_id, lanes[0][0], float(by_id[name].s))
        ahead = waypoint.transform.get_forward_vector()
        assert arrow @ [ahead.x, -ahead.y] < -0.5


def signal_token(signal: str) -> str:
    from carstage.exporters.formats.nuscenes_tables import token

    return token("map", TOWN, "traffic_light", signal)


def test_the_devkit_draws_every_layer(loaded) -> None:
    import matplotlib.pyplot as plt

    figure, _ = loaded.render_layers(loaded.non_geometric_layers, figsize=1)
    figure.canvas.draw()
    assert len(np.unique(np.asarray(figure.canvas.buffer_rgba()).reshape(-1, 4), axis=0)) > 20
    figure, _ = loaded.render_centerlines(figsize=1)
    figure.canvas.draw()
    plt.close("all")
    names = ["drivable_area", "lane", "walkway", "ped_crossing", "lane_divider"]
    masks = loaded.get_map_mask((600.0, 600.0, 300.0, 300.0), 0.0, names, (300, 300))
    shares = dict(zip(names, masks.reshape(len(names), -1).mean(axis=1), strict=True))
    assert all(share > 0.0 for share in shares.values()), shares
    assert shares["lane"] < shares["drivable_area"]


@pytest.mark.parametrize("mapped", [False, True])
def test_an_export_loads_and_draws_by_either_name(
    town_drive, devkit, map_api, tmp_path, monkeypatch, mapped: bool
) -> None:
    out = tmp_path / "out"
    export_dataset("nuscenes", town_drive, out, ExportOptions(nuscenes_locations=mapped), workers=0)
    nusc = devkit.NuScenes(NUSCENES_VERSION, str(out), verbose=False)
    (log,) = nusc.log
    location = log["location"]
    if mapped:
        assert location == "singapore-onenorth"
        from nuscenes.map_expansion.bitmap import BitMap

        bitmap = BitMap(str(out), location, "semantic_prior").image
        assert set(np.unique(bitmap)) == {0, 255}
    else:
        with pytest.raises(AssertionError, match="Unknown map name"):
            map_api.NuScenesMap(str(out), location)
        # The line that the documentation shows.
        monkeypatch.setattr(map_api, "locations", [*map_api.locations, location])
    town = map_api.NuScenesMap(str(out), location)
    (row,) = nusc.map
    height, width = row["mask"].mask().shape
    assert town.canvas_edge == [width / 10, height / 10]
    for pose in nusc.ego_pose:
        x, y, _ = pose["translation"]
        layers = town.layers_on_point(x, y)
        assert layers["lane"]
        assert row["mask"].is_on_mask(x, y)[0]
        assert town.get_closest_lane(x, y) == layers["lane"]
    (crossing,) = town.ped_crossing
    assert crossing["road_segment_token"] == town.road_segment[0]["token"]
    (stop,) = town.stop_line
    assert [cue["token"] for cue in stop["cue"]] == [town.traffic_light[0]["token"]]
    assert [part["segment_type"] for part in town.lane[0]["right_lane_divider_segments"]] == [
        "SINGLE_SOLID_WHITE",
        "NIL",
    ]
    poses, figure, _ = town.render_egoposes_on_fancy_map(nusc, verbose=False)
    assert len(poses) == len(nusc.sample)
    figure.canvas.draw()
    import matplotlib.pyplot as plt

    plt.close("all")


def test_a_dataset_without_a_vector_map_has_no_expansion(exported) -> None:
    assert not (exported("nuscenes") / "maps/expansion").exists()


def test_different_maps_of_one_name_are_two_locations(tmp_path: Path) -> None:
    dataset, out = tmp_path / "in", tmp_path / "out"
    make_dataset(dataset, tmp_path, size=SIZE, steps=2)
    add_episode(dataset, tmp_path, "fedcba9876543210", 2)
    attempts = sorted(dataset.glob("episodes/*/*"))
    for length_m, attempt in zip((60.0, 100.0), attempts, strict=True):
        road = small_maps.document(small_maps.road(1, 0.0, 0.0, 0.0, length_m))
        give_vector_map(dataset, attempt, road)
    export_dataset("nuscenes", dataset, out, workers=0)
    tables = out / NUSCENES_VERSION
    logs = {row["token"]: row for row in json.loads((tables / "log.json").read_text())}
    towns = {row["logfile"]: row["location"] for row in logs.values()}
    assert sorted(towns) == [attempt.parent.name for attempt in attempts]
    for length_m, attempt in zip((60.0, 100.0), attempts, strict=True):
        location = towns[attempt.parent.name]
        expansion = json.loads((out / f"maps/expansion/{location}.json").read_text())
        (path, *_) = expansion["arcline_path_3"].values()
        lengths = [sum(one["segment_length"]) for one in path]
        assert sum(lengths) == pytest.approx(length_m, abs=0.1)
    rows = json.loads((tables / "map.json").read_text())
    assert len({row["filename"] for row in rows}) == len(rows) == 2
    assert {row["carla_map"] for row in rows} == {Dataset(dataset).episodes[0].document["map"]}
    assert sorted(token for row in rows for token in row["log_tokens"]) == sorted(logs)


def test_more_towns_than_locations_are_refused() -> None:
    from types import SimpleNamespace

    episodes: Any = [SimpleNamespace(id=str(n), document={"map": f"Town{n:02}"}) for n in range(5)]
    with pytest.raises(BadInputError, match="knows 4 locations; there is none left for Town04"):
        grounds_of(episodes, town_names(episodes), nuscenes_locations=True)
    assert len(LOCATIONS) == 4


def test_arcs_follow_a_line_in_the_devkit_s_own_words(map_api) -> None:
    from nuscenes.map_expansion.arcline_path_utils import discretize_lane, length_of_lane

    angle = np.linspace(0.0, 1.5 * np.pi, 60)
    circle = 20.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
    station = np.linspace(0.0, 80.0, 200)
    heading = 0.5 * 0.1 * station**2 / 80.0
    step = np.stack([np.cos(heading), np.sin(heading)], axis=-1)[:-1] * (80.0 / 199)
    spiral = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    straight = np.array([[3.0, 4.0], [3.0, 4.0], [6.0, 8.0]])
    bend = np.concatenate([[[-90.0, 0.0]], circle[:20]])
    for line, most in ((circle, 3), (circle * (1, -1), 3), (spiral, 12), (straight, 1), (bend, 4)):
        paths = arcline_paths(line)
        assert len(paths) <= most
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        assert length_of_lane(paths) == pytest.approx(length, rel=0.01)
        dense = np.array(discretize_lane(paths, 0.01))[:, :2]
        middles = (line[1:] + line[:-1]) / 2
        for point in (*line[::7], *middles[::7]):
            assert np.linalg.norm(dense - point, axis=1).min() < TOLERANCE_M + 0.01
    assert arcline_paths(np.zeros((3, 2))) == []
