"""``carla.Map``: made by the client from the OpenDRIVE text that the server sends."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import carla

from client_api.entries import client_side, works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect


@works("World.get_map", "Map.name", "Map.get_spawn_points", "Map.to_opendrive",
       "Map.save_to_disk", "Map.transform_to_geolocation",
       "Map.geolocation_to_transform")  # fmt: skip
def _map(scene: TrialScene) -> None:
    """Spawn points lie on driving lanes; the OpenDRIVE text has a georeference."""
    town = scene.world.get_map()
    expect(town.name.startswith("Carla/Maps/"), f"its name is {town.name}")
    points = town.get_spawn_points()
    expect(len(points) > 20, f"{len(points)} spawn points")
    for point in points[:10]:
        lane = town.get_waypoint(point.location).transform.location
        expect(lane.distance(point.location) < 2.0, f"{point.location} is off the road")
    text = town.to_opendrive()
    expect("<OpenDRIVE" in text and "geoReference" in text, "the OpenDRIVE text")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "town.xodr"
        town.save_to_disk(str(path))
        expect(path.read_text().strip() == text.strip(), "save_to_disk")
    place = points[0].location
    geo = town.transform_to_geolocation(place)
    expect(math.isfinite(geo.latitude) and math.isfinite(geo.longitude), "latitude and longitude")
    if has("Map.geolocation_to_transform"):
        expect(town.geolocation_to_transform(geo).distance(place) < 1.0, "there and back")


@client_side("Map.get_waypoint", "Map.get_waypoint_xodr", "Map.get_topology",
             "Map.generate_waypoints", "Map.cook_in_memory_map", "Waypoint.*", "LaneMarking.*",
             "Junction.*", "Map.get_crosswalks")  # fmt: skip
def _lanes(scene: TrialScene) -> None:
    """Lanes are found, followed to their end and into junctions, and have markings."""
    town = scene.map
    point = town.get_spawn_points()[0]
    here = town.get_waypoint(point.location)
    again = town.get_waypoint_xodr(here.road_id, here.lane_id, here.s)
    expect(again.id == here.id, "the same place by road, lane and s")
    expect(here.lane_width > 2.0 and here.lane_type == carla.LaneType.Driving, "its lane")
    expect(here.section_id >= 0, "its section")
    expect(not has("Waypoint.is_rht") or here.is_rht, "its side")
    expect(here.transform.location.distance(point.location) < 2.0, "its place")
    ahead = here.next(2.0)
    expect(
        bool(ahead) and abs(ahead[0].transform.location.distance(point.location) - 2) < 1, "next"
    )
    expect(bool(here.previous(1.0)), "previous")
    expect(len(here.next_until_lane_end(1.0)) > 0, "to the lane's end")
    expect(len(here.previous_until_lane_start(1.0)) >= 0, "to its start")
    for neighbour in (here.get_left_lane(), here.get_right_lane()):
        expect(neighbour is None or neighbour.road_id == here.road_id, "a neighbour")
    expect(here.lane_change in carla.LaneChange.values.values(), "lane_change")
    for marking in (here.left_lane_marking, here.right_lane_marking):
        expect(marking.type in carla.LaneMarkingType.values.values(), "type of the marking")
        expect(marking.color in carla.LaneMarkingColor.values.values(), "its colour")
        expect(marking.lane_change in carla.LaneChange.values.values(), "its lane change")
        expect(marking.width >= 0.0, "its width")
    inside = next(w for w in town.generate_waypoints(3.0) if w.is_junction)
    junction = inside.get_junction()
    expect(inside.is_intersection and junction.id == inside.junction_id, "its junction")
    expect(len(junction.get_waypoints(carla.LaneType.Driving)) > 0, "the junction's lanes")
    expect(junction.bounding_box.extent.x > 1.0, "the junction's box")
    expect(len(town.get_topology()) > 5, "topology")
    expect(len(town.get_crosswalks()) % 5 == 0 and len(town.get_crosswalks()) > 0, "crosswalks")
    with tempfile.TemporaryDirectory() as folder:
        town.cook_in_memory_map(str(Path(folder) / "town"))


@client_side("Map.get_all_landmarks", "Map.get_all_landmarks_from_id",
             "Map.get_all_landmarks_of_type", "Map.get_landmark_group", "Landmark.*",
             "Waypoint.get_landmarks", "Waypoint.get_landmarks_of_type",
             "Map.get_all_road_marks", "Map.get_road_marks_from_id",
             "Map.get_all_road_marks_of_type", "RoadMark.*")  # fmt: skip
def _landmarks(scene: TrialScene) -> None:
    """Traffic lights and speed signs stand in the map, each with its lanes."""
    town = scene.map
    everything = town.get_all_landmarks()
    lights = town.get_all_landmarks_of_type("1000001")
    expect(0 < len(lights) <= len(everything), "traffic lights")
    mark = lights[0]
    expect(town.get_all_landmarks_from_id(mark.id)[0].id == mark.id, "found by id")
    expect(len(town.get_landmark_group(mark)) >= 0, "its group")
    for name in vars(carla.Landmark):
        if not name.startswith("__") and name != "get_lane_validities":
            getattr(mark, name)
    expect(mark.type == "1000001" and mark.is_dynamic, "its type")
    expect(len(mark.get_lane_validities()) > 0, "its lanes")
    before: Any = next(
        (w for p in town.get_spawn_points() if (w := town.get_waypoint(p.location)).get_landmarks(
            80.0, False)), None,
    )  # fmt: skip
    expect(before is not None, "no landmark ahead of any spawn point")
    ahead = before.get_landmarks(80.0, False)[0]
    expect(ahead.waypoint is not None and ahead.distance <= 80.0, "where it is met")
    kind = ahead.type
    expect(len(before.get_landmarks_of_type(80.0, kind, False)) > 0, "of its type")
    if not has("RoadMark.id"):
        return
    marks: list[Any] = list(town.get_all_road_marks())
    for road_mark in marks[:3]:
        for name in vars(carla.RoadMark):
            if not name.startswith("__"):
                getattr(road_mark, name)
    town.get_road_marks_from_id("0")
    town.get_all_road_marks_of_type("crosswalk")
