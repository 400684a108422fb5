"""Traffic lights and signs, and the calls of the world about them."""

from __future__ import annotations

from typing import Any

import carla

from client_api.entries import limited, works
from client_api.trial_scene import TrialScene, expect

_STATE = carla.TrafficLightState


def _light(scene: TrialScene) -> Any:
    lights = scene.world.get_actors().filter("traffic.traffic_light")
    expect(len(lights) > 3, f"{len(lights)} traffic lights")
    return next(light for light in lights if light.get_stop_waypoints())


@works("TrafficLight.set_state", "TrafficLight.get_state", "TrafficLight.state",
       "TrafficLight.get_elapsed_time", "TrafficLight.set_green_time",
       "TrafficLight.get_green_time", "TrafficLight.set_yellow_time",
       "TrafficLight.get_yellow_time", "TrafficLight.set_red_time",
       "TrafficLight.get_red_time")  # fmt: skip
def _states_and_times(scene: TrialScene) -> None:
    """A state that is set is shown; a green time that is set ends the green."""
    light = _light(scene)
    for state in (_STATE.Green, _STATE.Yellow, _STATE.Red, _STATE.Off):
        light.set_state(state)
        scene.ticks()
        expect(light.get_state() == state == light.state, f"{state} is not shown")
    before = light.get_green_time(), light.get_yellow_time(), light.get_red_time()
    group = light.get_group_traffic_lights()
    for one in group:
        one.set_green_time(1.0)
        one.set_yellow_time(0.5)
        one.set_red_time(0.5)
    scene.ticks()
    times = light.get_green_time(), light.get_yellow_time(), light.get_red_time()
    expect(times == (1.0, 0.5, 0.5), f"times {times}")
    scene.world.reset_all_traffic_lights()
    seen = set()
    for _ in range(60):
        scene.ticks()
        seen |= {one.get_state() for one in group}
    for one in group:
        one.set_green_time(before[0])
        one.set_yellow_time(before[1])
        one.set_red_time(before[2])
    scene.world.reset_all_traffic_lights()
    scene.ticks()
    expect({_STATE.Green, _STATE.Yellow, _STATE.Red} <= seen, f"seen {seen}")
    expect(light.get_elapsed_time() >= 0.0, "elapsed time")


@works("TrafficLight.freeze", "TrafficLight.is_frozen", "World.freeze_all_traffic_lights",
       "World.reset_all_traffic_lights", "TrafficLight.reset_group")  # fmt: skip
def _freezing(scene: TrialScene) -> None:
    """Frozen lights keep their state (the client freezes all); a reset begins with green."""
    light = _light(scene)
    for freeze in (scene.world.freeze_all_traffic_lights, light.freeze):
        freeze(True)
        scene.ticks(2)
        expect(light.is_frozen(), "it is not frozen")
        elapsed = light.get_elapsed_time()
        scene.ticks(5)
        expect(light.get_elapsed_time() == elapsed, "its time goes on")
        freeze(False)
        scene.ticks(2)
        expect(not light.is_frozen(), "it stays frozen")
    group = [light, *light.get_group_traffic_lights()]
    for reset in (light.reset_group, scene.world.reset_all_traffic_lights):
        for one in group:
            one.set_state(_STATE.Red)
        reset()
        scene.ticks()
        expect(any(one.get_state() == _STATE.Green for one in group), "no light is green")


@works("TrafficLight.get_pole_index", "TrafficLight.get_group_traffic_lights",
       "TrafficLight.get_affected_lane_waypoints", "TrafficLight.get_light_boxes",
       "TrafficLight.get_opendrive_id", "TrafficLight.get_stop_waypoints",
       "TrafficSign.trigger_volume")  # fmt: skip
def _whereabouts(scene: TrialScene) -> None:
    """A light knows its group, its stop lines, its lanes, its heads and its OpenDRIVE signal."""
    light = _light(scene)
    group = light.get_group_traffic_lights()
    expect(light.id in [one.id for one in group] and len(group) > 1, "its group")
    indices = [one.get_pole_index() for one in group]
    expect(len(set(indices)) == len(indices), f"pole indices {indices}")
    here = light.get_location()
    stops = light.get_stop_waypoints()
    expect(all(w.transform.location.distance(here) < 60.0 for w in stops), "stop lines far off")
    expect(len(light.get_affected_lane_waypoints()) > 0, "its lanes")
    boxes = light.get_light_boxes()
    expect(len(boxes) > 0 and all(b.location.z > 2.0 for b in boxes), "its heads")
    expect(light.trigger_volume.extent.length() > 0.5, "its trigger volume")
    signal = light.get_opendrive_id()
    expect(len(scene.map.get_all_landmarks_from_id(signal)) > 0, f"signal {signal}")


@works("World.get_traffic_light", "World.get_traffic_light_from_opendrive_id",
       "World.get_traffic_lights_from_waypoint",
       "World.get_traffic_lights_in_junction")  # fmt: skip
def _finding(scene: TrialScene) -> None:
    """A light is found by its landmark, its signal, the way to it and its junction."""
    light = _light(scene)
    signal = light.get_opendrive_id()
    landmark = scene.map.get_all_landmarks_from_id(signal)[0]
    expect(scene.world.get_traffic_light(landmark).id == light.id, "by landmark")
    found = scene.world.get_traffic_light_from_opendrive_id(signal)
    expect(found.id == light.id, "by signal")
    way = light.get_stop_waypoints()[0].previous(10.0)
    ahead = [one.id for w in way for one in scene.world.get_traffic_lights_from_waypoint(w, 40.0)]
    expect(light.id in ahead, "on the way to it")
    junction = next(w.get_junction().id for w in light.get_affected_lane_waypoints()
                    for w in [w, *w.next(2.0), *w.next(8.0)] if w.is_junction)  # fmt: skip
    inside = [one.id for one in scene.world.get_traffic_lights_in_junction(junction)]
    expect(light.id in inside, f"junction {junction} has {inside}")


@limited("None for speed signs: the town's signs are scenery, not actors.",
         "World.get_traffic_sign")  # fmt: skip
def _signs(scene: TrialScene) -> None:
    light = _light(scene)
    landmark = scene.map.get_all_landmarks_from_id(light.get_opendrive_id())[0]
    sign = scene.world.get_traffic_sign(landmark)
    expect(sign is None or sign.id == light.id, "another sign")
