"""Maps that are not ours: what little they may hold, and what must come out all the same."""

from __future__ import annotations

import carla
import numpy as np
import pytest
import shapely

import small_maps
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import BakeOptions, MapSamplingError, Town
from carstage_sim.maps.baking import bake, sample_in_child
from carstage_sim.maps.ground import Ground
from carstage_sim.maps.loading import town_from_opendrive
from carstage_sim.maps.signals import SPEED_LIMIT, signal_plan
from carstage_sim.maps.strips import driving_lanes
from carstage_sim.maps.town import MapLayer
from carstage_sim.world.state import ActorKind
from carstage_sim.world.world import World

BARE = BakeOptions(scenery=False)


@pytest.fixture(scope="module")
def bridge() -> Town:
    return bake("Bridge", small_maps.crossing_on_two_levels(), BARE)


def test_one_road_without_junction_sidewalk_or_reference_becomes_a_town():
    town = bake("Country", small_maps.one_road())
    assert len(town.spawn_points) > 10
    assert town.traffic_lights == ()
    assert town.navigation == b""
    # What the client itself takes for the origin of such a map.
    assert town.geo_reference == pytest.approx((42.0, 2.0))
    assert not [entry for entry in town.level_objects if entry.layer == MapLayer.BUILDINGS]
    on_road = town.lanes.location[::10]
    assert Ground(town.static_mesh).highest(on_road[:, :2]) == pytest.approx(0.0, abs=1e-6)


def test_elements_of_asam_s_namespace_are_read_as_carla_reads_them():
    signals = small_maps.light(7, 190, (-1, -1))
    text = small_maps.document(small_maps.road(1, 0, 0, 0, 200, signals=signals))
    named = 'xmlns="http://code.asam.net/simulation/standard/opendrive_schema"'
    foreign = '<x:road xmlns:x="http://x" id="2"/></OpenDRIVE>'
    text = text.replace("<OpenDRIVE>", f"<OpenDRIVE {named}>").replace("</OpenDRIVE>", foreign)
    town = bake("Named", text, BARE)
    read = {w.lane_id for w in carla.Map("Named", text).generate_waypoints(10.0)}
    assert set(town.lanes.lane_id.tolist()) == read == {-1, 1}
    assert [site.sign_id for site in town.traffic_lights] == ["7"]


def test_the_road_surface_follows_a_hill():
    town = bake("Hill", small_maps.hill_road(), BARE)
    lanes = town.lanes.location
    assert np.ptp(lanes[:, 2]) == pytest.approx(6.0, abs=0.01)
    surface = Ground(town.static_mesh).highest(lanes[:, :2])
    assert np.abs(surface - lanes[:, 2]).max() < 0.02
    # The land meets the road at its edge and ends up between the heights of the road.
    land = town.static_mesh.tag == CityObjectLabel.TERRAIN
    heights = town.static_mesh.vertices[town.static_mesh.triangles[land]][..., 2]
    assert heights.min() > -0.01
    assert heights.max() < 6.01


def test_a_road_that_ends_where_it_begins_becomes_a_town():
    radius_m, length_m = 20.0, 40.0 * np.pi
    loop = small_maps.road(1, 0, 0, 0, length_m).replace("<line/>", '<arc curvature="0.05"/>')
    town = bake("Loop", small_maps.document(loop), BARE)
    mesh = town.static_mesh
    road = mesh.vertices[mesh.triangles[mesh.tag == CityObjectLabel.ROADS]][..., :2]
    from_middle = np.linalg.norm(road - (0.0, -radius_m), axis=-1)
    assert from_middle.max() == pytest.approx(radius_m + 3.5, abs=0.1)
    around = np.degrees(np.arctan2(road[..., 1] + radius_m, road[..., 0]))
    assert np.histogram(around, 12, (-180, 180))[0].min() > 0
    assert len(town.spawn_points) > 10


def test_spawn_points_stand_above_their_lane_and_slope_with_it():
    town = bake("Hill", small_maps.hill_road(), BARE)
    points = town.spawn_points
    nearest = [
        np.linalg.norm(town.lanes.location[:, :2] - point[:2], axis=1).argmin() for point in points
    ]
    height = points[:, 2] - town.lanes.location[nearest, 2]
    assert height == pytest.approx(0.5, abs=0.05)
    assert np.abs(points[:, 3]).max() > 3.0


def test_a_road_that_crosses_above_another_is_a_bridge(bridge):
    ground = Ground(bridge.static_mesh)
    middle = np.array([[1.7, 1.7]])
    assert ground.highest(middle) == pytest.approx(6.0, abs=0.02)
    mesh = bridge.static_mesh
    above = np.linalg.norm(mesh.vertices[:, :2] - middle[0], axis=1) < 3.0
    flat = mesh.vertices[above][:, 2]
    assert ((flat < 0.05) | (flat > 4.9)).all(), "something stands between the two roads"
    assert (mesh.tag == CityObjectLabel.BRIDGE).any()
    assert (mesh.tag == CityObjectLabel.GUARD_RAIL).any()


def test_a_sign_of_a_bridge_does_not_stand_on_the_road_below(bridge):
    signs = [one for one in bridge.level_objects if one.label == CityObjectLabel.TRAFFIC_SIGNS]
    (sign,) = signs
    assert sign.box.center[:2] == pytest.approx((-90.0, 6.0), abs=0.3)


def test_land_covers_no_road_and_lies_below_bridges(bridge):
    mesh = bridge.static_mesh
    land = mesh.vertices[mesh.triangles[mesh.tag == CityObjectLabel.TERRAIN]].astype(np.float64)
    tree = shapely.STRtree(shapely.polygons(land[..., :2]))
    lower, upper = (bridge.lanes.location[bridge.lanes.road_id == road] for road in (1, 2))
    assert len(tree.query(shapely.points(lower[:, :2]), predicate="within")[0]) == 0
    ground = Ground(mesh)
    assert ground.highest(upper[:, :2]) == pytest.approx(upper[:, 2], abs=0.02)


def test_parked_vehicles_keep_clear_of_driving_lanes():
    town = bake("Street", small_maps.parking_street())
    parked = [entry for entry in town.level_objects if entry.layer == MapLayer.PARKED_VEHICLES]
    assert len(parked) > 8
    for entry in parked:
        assert entry.label in (CityObjectLabel.CAR, CityObjectLabel.TRUCK)
        inner_edge = abs(entry.box.center[1]) - entry.box.extent[1]
        assert inner_edge >= 3.5 + 0.3
        assert entry.box.center[2] - entry.box.extent[2] == pytest.approx(0.0, abs=0.03)


def test_everything_stands_on_the_ground():
    town = bake("Street", small_maps.parking_street())
    ground = Ground(town.static_mesh)
    for entry in town.level_objects:
        lowest = entry.box.center[2] - entry.box.extent[2]
        x, y, _ = entry.box.center
        reach = max(entry.box.extent[:2])
        below = ground.highest(np.array([(x, y), (x, y - reach), (x, y + reach)]))
        # Feet of benches reach into the ground.
        deepest_m = 0.1 if entry.name.startswith("Bench") else 0.03
        gap_m = lowest - below
        assert ((gap_m > -deepest_m) & (gap_m < 0.03)).any(), entry.name


def test_lights_without_controllers_take_turns_by_approach():
    signals = small_maps.light(7, 190, (-1, -1)) + small_maps.light(8, 190, (-1, -1), -9.0)
    town = bake("Lit", small_maps.document(small_maps.road(1, 0, 0, 0, 200, signals=signals)), BARE)
    assert {site.sign_id for site in town.traffic_lights} == {"7", "8"}
    assert len({site.junction_id for site in town.traffic_lights}) == 2
    for site in town.traffic_lights:
        (box,) = site.trigger
        assert box.center[0] < 190.0
        assert abs(box.center[1] - 1.75) < 0.01


def speed_sign(signal_id: int, s: float, says: str) -> str:
    sign = small_maps.light(signal_id, s, (-1, -1)).replace("1000001", "274")
    return sign.replace('subtype="-1" value="-1"', says)


@pytest.mark.parametrize(
    ("says", "limit_kmh"),
    [
        ('subtype="-1" value="50"', 50.0),
        ('subtype="-1" value="50" unit="km/h"', 50.0),
        ('subtype="-1" value="35" unit="mph"', 56.327),
        ('subtype="-1" value="12.5" unit="m/s"', 45.0),
        ('subtype="35" unit="mph"', 56.327),
        ('subtype="50"', 50.0),
        # Nothing: what was before goes on.
        ('subtype="-1" value="-1"', 30.0),
        ('subtype="-1" value="-1" unit="mph"', 30.0),
        ("", 30.0),
    ],
)
def test_a_speed_limit_is_the_number_on_the_sign_in_its_unit(says, limit_kmh):
    road = small_maps.road(1, 0, 0, 0, 200, signals=speed_sign(7, 100, says))
    samples = sample_in_child(small_maps.document(road), "Limited")
    lanes = driving_lanes(samples, signal_plan(samples["record"]).of_kind(SPEED_LIMIT))
    limits = np.unique(lanes.speed_limit_kmh[lanes.lane_id == -1])
    assert limits == pytest.approx([limit_kmh], abs=1e-2)


def test_a_sign_that_is_an_object_says_kmh():
    # The client says mph of those; CARLA's server drives so many km/h.
    drawn = '<object id="9" name="Speed_60" type="-1" s="60" t="-5" hdg="0" length="1" width="1"/>'
    road = small_maps.road(1, 0, 0, 0, 200, objects=drawn)
    samples = sample_in_child(small_maps.document(road), "Limited")
    (sign,) = signal_plan(samples["record"]).of_kind(SPEED_LIMIT)
    assert sign.value == 60.0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("no xml at all", "no well-formed XML"),
        ("<OpenDRIVE>", "no well-formed XML"),
        ("<svg/>", "not an <OpenDRIVE>"),
        ('<x:OpenDRIVE xmlns:x="http://x"/>', "not an <OpenDRIVE>"),
        ("<OpenDRIVE><header/></OpenDRIVE>", "no <road>"),
        (small_maps.one_road().replace('id="1"', 'id="main"', 1), "no whole number"),
        (small_maps.one_road().replace('length="200"', 'length="nan"'), "is no number"),
        (small_maps.one_road().replace("planView", "view"), "no <planView>"),
        (small_maps.one_road().replace('type="driving"', 'type="sidewalk"'), "type driving"),
        (small_maps.document(*2 * [small_maps.road(1, 0, 0, 0, 9)]), "two roads"),
        (small_maps.document(small_maps.road(1, 0, 0, 0, 6e6)), "beyond 1000 km"),
        (small_maps.document(small_maps.road(1, 2e6, 0, 0, 9)), "beyond 1000 km"),
        (small_maps.document(*(small_maps.road(n, 0, 0, 0, 9e5) for n in range(6))), "km of road"),
        ('<!DOCTYPE a [<!ENTITY b "b">]><OpenDRIVE name="&b;"/>', "declares XML entities"),
        ("<?xml version='1.0' encoding='utf-7'?>+ADw-!DOCTYPE", "no well-formed XML"),
        ("<OpenDRIVE>\udcff</OpenDRIVE>", "no UTF-8"),
    ],
)
def test_a_broken_map_is_refused_with_its_name_and_reason(text, reason, tmp_path):
    with pytest.raises(MapSamplingError, match=reason) as caught:
        town_from_opendrive("Broken", text, cache_folder=tmp_path)
    assert "Broken" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_stop_and_yield_signs_become_actors_with_a_trigger_before_them():
    stop = small_maps.light(5, 150, (-1, -1)).replace("1000001", "206")
    give_way = small_maps.light(6, 100, (-1, -1)).replace("1000001", "205")
    text = small_maps.document(small_maps.road(1, 0, 0, 0, 200, signals=stop + give_way))
    town = bake("Signed", text, BARE)
    found = {site.sign_id: site for site in town.traffic_signs}
    assert {key: site.type_id for key, site in found.items()} == {
        "5": "traffic.stop",
        "6": "traffic.yield",
    }
    (box,) = found["5"].trigger
    assert 145.0 < box.center[0] < 150.0
    assert [entry.name.split("_")[0] for entry in town.level_objects] == ["StopSign", "YieldSign"]
    world = World(town, 1)
    snapshot = world.freeze(0.0)
    assert snapshot.traffic_signs is not None
    assert snapshot.traffic_signs.sign_id == ("5", "6")
    sign = world.actors.of_kind(ActorKind.TRAFFIC_SIGN)[0]
    assert sign.type_id == "traffic.stop"
    assert not world.destroy(sign.actor_id)
