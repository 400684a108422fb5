"""Street lights: ``carla.LightManager`` and its lights."""

from __future__ import annotations

from statistics import fmean
from typing import Any

import carla

from client_api.entries import limited, works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect, look_at


def _lights(scene: TrialScene) -> tuple[Any, list[Any]]:
    manager = scene.world.get_lightmanager()
    lights = sorted(manager.get_all_lights(carla.LightGroup.Street), key=lambda light: light.id)
    expect(len(lights) > 3, f"{len(lights)} street lights")
    return manager, lights


@limited("The town's lamps are lights of the group Street; vehicles and buildings have none here. "
         "Client 0.9.13 reads states once.",
         "World.get_lightmanager", "LightManager.get_all_lights",
         "LightManager.get_turned_on_lights", "LightManager.get_turned_off_lights",
         "LightManager.set_day_night_cycle")  # fmt: skip
def _day_and_night(scene: TrialScene) -> None:
    manager, lights = _lights(scene)
    street = carla.LightGroup.Street
    expect(not manager.get_all_lights(carla.LightGroup.Building), "lights of buildings")
    scene.world.set_weather(carla.WeatherParameters.ClearNight)
    if not has("LightManager.set_day_night_cycle"):
        scene.ticks(3)
        anew = scene.seen_anew().get_lightmanager()
        scene.until(lambda: len(anew.get_turned_on_lights(street)) == len(lights), "dusk", 20)
        scene.world.set_weather(carla.WeatherParameters.Default)
        return
    scene.until(lambda: len(manager.get_turned_on_lights(street)) == len(lights), "dusk", 20)
    scene.world.set_weather(carla.WeatherParameters.ClearNoon)
    scene.until(lambda: len(manager.get_turned_off_lights(street)) == len(lights), "dawn", 20)
    manager.set_day_night_cycle(False)
    scene.world.set_weather(carla.WeatherParameters.ClearNight)
    scene.ticks(3)
    off = len(manager.get_turned_off_lights(street))
    manager.set_day_night_cycle(True)
    scene.until(lambda: len(manager.get_turned_on_lights(street)) == len(lights), "cycle", 20)
    scene.world.set_weather(carla.WeatherParameters.Default)
    expect(off == len(lights), "without the cycle, dusk turned lights on")


@works("LightManager.turn_on", "LightManager.turn_off", "LightManager.set_active",
       "LightManager.is_active", "LightManager.set_color", "LightManager.set_colors",
       "LightManager.get_color", "LightManager.set_intensity", "LightManager.set_intensities",
       "LightManager.get_intensity", "LightManager.set_light_group",
       "LightManager.set_light_groups", "LightManager.get_light_group",
       "LightManager.set_light_state", "LightManager.set_light_states",
       "LightManager.get_light_state", "LightState.*", "Light.*")  # fmt: skip
def _switching(scene: TrialScene) -> None:
    """By night a lamp lights the street below it, in its colour and strength."""
    manager, lights = _lights(scene)
    lamp = lights[0]
    scene.world.set_weather(carla.WeatherParameters.ClearNight)
    scene.ticks(3)
    everything = list(lights)
    manager.turn_off(everything)
    scene.ticks(2)  # the client sends changes with the frame after them
    ground = carla.Location(lamp.location.x, lamp.location.y, 0.0)
    view = look_at(ground, 8.0, pitch_deg=40.0)
    dark = scene.picture(view)
    lamp.turn_on()
    scene.ticks(2)
    lit = scene.picture(view)
    expect(lit.mean() > dark.mean() + 8.0, f"the lamp lights nothing: {dark.mean()}, {lit.mean()}")
    expect(lamp.is_on and manager.is_active([lamp]) == [True], "the lamp is not on")
    lamp.set_color(carla.Color(255, 0, 0))
    scene.ticks(2)
    red = scene.picture(view)
    expect(fmean(red.red) > 1.5 * fmean(red.blue) + 2, "its light is not red")
    expect(manager.get_color([lamp])[0] == carla.Color(255, 0, 0) == lamp.color, "its colour")
    lamp.set_color(carla.Color(255, 255, 255))
    lamp.set_intensity(40_000.0)
    scene.ticks(2)
    bright = scene.picture(view)
    expect(bright.mean() > lit.mean() + 5.0, "four times the intensity is no brighter")
    expect(manager.get_intensity([lamp]) == [40_000.0] == [lamp.intensity], "its intensity")
    state = carla.LightState(5_000.0, carla.Color(0, 255, 0), carla.LightGroup.Street, False)
    lamp.set_light_state(state)
    scene.ticks(2)
    kept = lamp.light_state
    expect((kept.intensity, kept.active) == (5_000.0, False), "its state")
    expect(kept.color == carla.Color(0, 255, 0), "its state's colour")
    expect(kept.group == carla.LightGroup.Street == lamp.light_group, "its group")
    two = [lights[0], lights[1]]
    manager.set_light_states(two, [state, state])
    manager.set_light_state(two, state)
    expect([s.intensity for s in manager.get_light_state(two)] == [5_000.0] * 2, "states of two")
    manager.set_colors(two, [carla.Color(1, 2, 3), carla.Color(4, 5, 6)])
    manager.set_color([lamp], carla.Color(1, 2, 3))
    manager.set_intensities(two, [100.0, 200.0])
    manager.set_intensity([lamp], 100.0)
    manager.set_active(two, [True, False])
    manager.set_light_groups(two, [carla.LightGroup.Other, carla.LightGroup.Street])
    manager.set_light_group([lights[1]], carla.LightGroup.Street)
    scene.ticks(2)
    expect(manager.get_light_group(two)[0] == carla.LightGroup.Other, "groups")
    expect(manager.is_active(two) == [True, False], "set_active")
    lamp.set_light_group(carla.LightGroup.Street)
    lamp.turn_off()
    expect(lamp.id > 0 and lamp.location.z > 3.0, "id and place")
    new = carla.LightState(10_000.0, carla.Color(255, 232, 190), carla.LightGroup.Street, False)
    manager.set_light_state(everything, new)
    scene.world.set_weather(carla.WeatherParameters.Default)
    scene.ticks(2)
