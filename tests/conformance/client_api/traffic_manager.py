"""``carla.TrafficManager``: it runs in the client; its effects are seen on the server's cars."""

from __future__ import annotations

from typing import Any

import carla

from client_api.entries import limited, works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect


def _driven(scene: TrialScene, ticks: int = 0, **_: Any) -> Any:
    car = scene.car()
    manager = scene.traffic_manager
    manager.ignore_lights_percentage(car, 100.0)
    manager.auto_lane_change(car, False)
    car.set_autopilot(True, manager.get_port())
    scene.ticks(ticks)
    return car


@works("Client.get_trafficmanager", "TrafficManager.get_port",
       "TrafficManager.set_synchronous_mode", "TrafficManager.set_random_device_seed")  # fmt: skip
def _manager(scene: TrialScene) -> None:
    """The manager of a port is found again; synchronous and seeded, it drives."""
    manager = scene.client.get_trafficmanager(scene.traffic_manager.get_port())
    expect(manager.get_port() == scene.traffic_manager.get_port(), "another port")
    manager.set_synchronous_mode(True)
    manager.set_random_device_seed(5)
    car = _driven(scene)
    scene.until(lambda: car.get_velocity().length() > 3.0, "it drives")


@works("TrafficManager.vehicle_percentage_speed_difference", "TrafficManager.set_desired_speed",
       "TrafficManager.global_percentage_speed_difference")  # fmt: skip
def _speeds(scene: TrialScene) -> None:
    """A desired speed is driven; a percentage slows a car, and all cars."""
    manager = scene.traffic_manager
    car = _driven(scene)
    if has("TrafficManager.set_desired_speed"):
        manager.set_desired_speed(car, 18.0)
        scene.until(lambda: abs(3.6 * car.get_velocity().length() - 18.0) < 2.0, "18 km/h")
    manager.vehicle_percentage_speed_difference(car, 90.0)
    scene.until(lambda: car.get_velocity().length() < 2.5, "90 % slower is slow", 300)
    other = _driven(scene, 100)
    fast = other.get_velocity().length()
    expect(fast > 4.0, "it does not drive")
    manager.global_percentage_speed_difference(90.0)
    scene.until(lambda: other.get_velocity().length() < 0.5 * fast, "all are slower", 300)
    manager.global_percentage_speed_difference(30.0)


@works("TrafficManager.vehicle_lane_offset", "TrafficManager.global_lane_offset")
def _offsets(scene: TrialScene) -> None:
    """A car keeps the given offset from its lane's middle."""
    manager = scene.traffic_manager
    car = _driven(scene)

    def aside() -> float:
        pose = car.get_transform()
        lane = scene.map.get_waypoint(pose.location).transform
        return float((pose.location - lane.location).dot(lane.get_right_vector()))

    manager.set_desired_speed(car, 20.0)
    manager.vehicle_lane_offset(car, 0.6)
    scene.until(lambda: 0.3 < aside() < 0.9, "0.6 m to the right")
    manager.global_lane_offset(0.0)
    manager.vehicle_lane_offset(car, 0.0)


@works("TrafficManager.update_vehicle_lights")
def _lights(scene: TrialScene) -> None:
    """By night a car with automatic lights has its beams on."""
    car = _driven(scene)
    scene.traffic_manager.update_vehicle_lights(car, True)
    scene.world.set_weather(carla.WeatherParameters.ClearNight)
    beam = int(carla.VehicleLightState.LowBeam)
    scene.until(lambda: bool(int(car.get_light_state()) & beam), "low beam", 40)
    scene.world.set_weather(carla.WeatherParameters.Default)
    scene.traffic_manager.update_vehicle_lights(car, False)


@works("TrafficManager.set_path", "TrafficManager.set_route", "TrafficManager.get_next_action",
       "TrafficManager.get_all_actions")  # fmt: skip
def _routes(scene: TrialScene) -> None:
    """A car follows the places that it is given, and announces its next actions."""
    manager = scene.traffic_manager
    car = _driven(scene)
    here = scene.map.get_waypoint(car.get_location())
    ahead = here.next(30.0)[0].transform.location
    manager.set_path(car, [ahead])
    scene.until(lambda: car.get_location().distance(ahead) < 6.0, "it came by", 400)
    manager.set_route(car, ["Straight"])
    scene.ticks(5)
    action = manager.get_next_action(car)
    expect(len(action) == 2, f"next action {action}")
    expect(len(manager.get_all_actions(car)) >= 1, "all actions")


@works("TrafficManager.collision_detection", "TrafficManager.distance_to_leading_vehicle",
       "TrafficManager.set_global_distance_to_leading_vehicle",
       "TrafficManager.ignore_vehicles_percentage",
       "TrafficManager.ignore_walkers_percentage")  # fmt: skip
def _following(scene: TrialScene) -> None:
    """A car stops behind a parked one, farther off if set so, and not if it ignores it."""
    manager = scene.traffic_manager
    car = _driven(scene)
    manager.set_global_distance_to_leading_vehicle(2.0)
    manager.distance_to_leading_vehicle(car, 5.0)
    manager.ignore_walkers_percentage(car, 0.0)
    ahead = scene.map.get_waypoint(car.get_location()).next(25.0)[0].transform
    ahead.location.z += 0.3
    parked = scene.spawn("vehicle.carlamotors.carlacola", ahead)
    parked.set_simulate_physics(False)
    scene.ticks(20)
    scene.until(lambda: car.get_velocity().length() < 0.1, "it stops", 300)
    gap = car.get_location().distance(parked.get_location())
    expect(gap > 7.0, f"it stops {gap:.1f} m from the middle of the parked one")
    manager.ignore_vehicles_percentage(car, 100.0)
    manager.collision_detection(car, parked, False)
    scene.until(lambda: car.get_velocity().length() > 0.3, "it ignores the parked one", 100)


@works("TrafficManager.force_lane_change", "TrafficManager.auto_lane_change",
       "TrafficManager.keep_slow_lane_rule_percentage",
       "TrafficManager.keep_right_rule_percentage",
       "TrafficManager.random_left_lanechange_percentage",
       "TrafficManager.random_right_lanechange_percentage")  # fmt: skip
def _lane_changes(scene: TrialScene) -> None:
    """A car changes lane on request, where there is a lane next to it."""
    manager = scene.traffic_manager
    place = next(
        (p for p in scene.map.get_spawn_points()
         if _beside(scene.map.get_waypoint(p.location))), None,
    )  # fmt: skip
    car = scene.spawn("vehicle.audi.tt", place or scene.place())
    manager.ignore_lights_percentage(car, 100.0)
    # CARLA 0.9.16 gave it another name.
    slow_lane = has("TrafficManager.keep_slow_lane_rule_percentage")
    for setter in (manager.keep_slow_lane_rule_percentage
                   if slow_lane else manager.keep_right_rule_percentage,
                   manager.random_left_lanechange_percentage,
                   manager.random_right_lanechange_percentage):  # fmt: skip
        setter(car, 0.0)
    manager.auto_lane_change(car, False)
    car.set_autopilot(True, manager.get_port())
    scene.ticks(20)
    here = scene.map.get_waypoint(car.get_location())
    to_right = _driving(here.get_right_lane(), here)
    manager.force_lane_change(car, to_right)
    if place is None:
        return

    def changed_lane() -> bool:
        now = scene.map.get_waypoint(car.get_location())
        return bool(now.road_id == here.road_id and now.lane_id != here.lane_id)

    scene.until(changed_lane, "the lane change", 200)


def _driving(neighbour: Any, lane: Any) -> bool:
    return bool(
        neighbour is not None
        and neighbour.lane_type == carla.LaneType.Driving
        and neighbour.lane_id * lane.lane_id > 0
    )


def _beside(lane: Any) -> bool:
    """Whether a lane has another one of its direction, for the next forty metres."""
    ahead = lane.next(40.0)
    return bool(
        ahead
        and ahead[0].road_id == lane.road_id
        and any(_driving(n, lane) for n in (lane.get_left_lane(), lane.get_right_lane()))
    )


@works("TrafficManager.ignore_lights_percentage", "TrafficManager.ignore_signs_percentage")
def _red_lights(scene: TrialScene) -> None:
    """A car waits at a red light, and drives on when it ignores lights."""
    manager = scene.traffic_manager
    lights = scene.world.get_actors().filter("traffic.traffic_light")
    light = next(one for one in lights if one.get_stop_waypoints())
    stop = light.get_stop_waypoints()[0]
    start = (stop.previous(18.0) or stop.previous(8.0))[0].transform
    start.location.z += 0.3
    car = scene.spawn("vehicle.audi.tt", start)
    scene.world.freeze_all_traffic_lights(True)
    for one in [light, *light.get_group_traffic_lights()]:
        one.set_state(carla.TrafficLightState.Red)
    manager.ignore_signs_percentage(car, 100.0)
    manager.ignore_lights_percentage(car, 0.0)
    car.set_autopilot(True, manager.get_port())
    scene.ticks(20)
    scene.until(lambda: car.get_velocity().length() < 0.1, "it waits", 300)
    waited_at = car.get_location()
    scene.ticks(20)
    expect(car.get_location().distance(waited_at) < 1.0, "it creeps over the line")
    manager.ignore_lights_percentage(car, 100.0)
    scene.until(lambda: car.get_location().distance(waited_at) > 6.0, "it drives on", 200)
    scene.world.freeze_all_traffic_lights(False)
    scene.world.reset_all_traffic_lights()


@works("TrafficManager.set_hybrid_physics_mode", "TrafficManager.set_hybrid_physics_radius",
       "TrafficManager.set_osm_mode")  # fmt: skip
def _hybrid(scene: TrialScene) -> None:
    """Far from the hero, cars go on without physics."""
    manager = scene.traffic_manager
    hero = scene.car("vehicle.audi.tt", role_name="hero")
    far = max(scene.map.get_spawn_points(), key=lambda p: p.location.distance(hero.get_location()))
    car = scene.spawn("vehicle.audi.tt", far)
    manager.ignore_lights_percentage(car, 100.0)
    manager.set_osm_mode(True)
    manager.set_hybrid_physics_mode(True)
    manager.set_hybrid_physics_radius(20.0)
    car.set_autopilot(True, manager.get_port())
    before = car.get_location()
    scene.ticks(60)
    manager.set_hybrid_physics_mode(False)
    expect(car.get_location().distance(before) > 3.0, "it does not move")


@limited("Accepted; no map here has tiles whose vehicles sleep.",
         "TrafficManager.set_respawn_dormant_vehicles",
         "TrafficManager.set_boundaries_respawn_dormant_vehicles")  # fmt: skip
def _dormant(scene: TrialScene) -> None:
    scene.traffic_manager.set_respawn_dormant_vehicles(False)
    scene.traffic_manager.set_boundaries_respawn_dormant_vehicles(25.0, 100.0)
    scene.ticks(2)


@works("TrafficManager.shut_down", own_process=True)
def _shut_down(scene: TrialScene) -> None:
    """A manager that is shut down gives its port back: the next one gets it."""
    port = scene.traffic_manager.get_port()
    scene.traffic_manager.shut_down()
    expect(scene.client.get_trafficmanager(port).get_port() == port, "the port is lost")
