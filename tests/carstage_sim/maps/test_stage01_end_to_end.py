"""Stage01 through a running server: lights and walkways as the real client finds them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.walkers import walked_through
from carstage_sim.maps import ground_height

if TYPE_CHECKING:
    from carstage_sim.maps import Town
    from running_simulator import RunningSimulator

pytestmark = pytest.mark.end_to_end

UP = np.array([0.0, 0.0, 500.0])


def trial_of_the_map(port: int) -> dict[str, Any]:
    import carla

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(20.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.05
    world.apply_settings(settings)
    world = client.reload_world(False)
    world.tick()
    town = world.get_map()
    marks = [mark for mark in town.get_all_landmarks() if mark.type == "1000001"]
    lights = []
    for mark in marks:
        actor = world.get_traffic_light(mark)
        stops = actor.get_stop_waypoints()
        lights.append(
            {
                "id": mark.id,
                "sign": actor.get_opendrive_id(),
                "stops": sorted((w.road_id, w.lane_id) for w in stops),
                "affected": sorted(
                    (w.road_id, w.lane_id) for w in actor.get_affected_lane_waypoints()
                ),
                "group": len(actor.get_group_traffic_lights()),
            }
        )
    world.set_pedestrians_seed(11)
    places = [world.get_random_location_from_navigation() for _ in range(60)]
    house = world.get_level_bbs(carla.CityObjectLabel.Buildings)[0]
    inside = np.array([house.location.x, house.location.y, 1.0])
    reach = np.array([2.0 * max(house.extent.x, house.extent.y), 0.0, 0.0])
    return {
        "lights": lights,
        "places": [(place.x, place.y, place.z) for place in places if place is not None],
        "spawn_points": len(town.get_spawn_points()),
        "through_a_house": walked_through(world, inside - reach, inside + reach),
        "above_a_house": walked_through(world, inside - reach + UP, inside + reach + UP),
        "buildings": len(world.get_environment_objects(carla.CityObjectLabel.Buildings)),
    }


def test_the_client_finds_lights_walkways_and_scenery(
    simulator: RunningSimulator, stage01: Town
) -> None:
    found = run_trial(trial_of_the_map, simulator.port, timeout_s=120)
    assert len(found["lights"]) == len(stage01.traffic_lights)
    for light in found["lights"]:
        assert light["sign"] == light["id"]
        assert light["stops"]
        assert light["stops"] == light["affected"]
        assert light["group"] in (3, 4)
    assert found["spawn_points"] == len(stage01.spawn_points)
    assert found["buildings"] > 80
    assert found["through_a_house"] == "Buildings"
    assert found["above_a_house"] is None
    places = np.array(found["places"])
    assert len(places) == 60
    height = ground_height(stage01)(places)
    assert places[:, 2] == pytest.approx(height, abs=0.02)
    assert (np.ptp(places[:, :2], axis=0) > 150.0).all()
