"""A page of pictures to be looked at one by one: vehicles, people, towns, weathers, night."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.simulator.render.people_sheet import every_pedestrian, people_pictures
from benchmarks.simulator.render.scene import ReferenceScene, named_presets, populate, rgb, town_of
from benchmarks.simulator.render.vehicle_sheet import every_vehicle
from carstage.report.html import figure, page
from carstage_sim.sensors import WorldSensors
from carstage_sim.world.state import ActorKind, Weather, WorldState

Pixels = NDArray[np.uint8]

PAGE = "index.html"
TOWNS = ("Stage01", "Stage02", "Stage03")
WEATHERS = ("ClearNoon", "CloudyNoon", "MidRainyNoon", "HardRainNoon", "DustStorm", "ClearSunset",
            "WetSunset", "ClearNight", "HardRainNight")  # fmt: skip
_PLACES = 3
_DUSK_DEG = 2.0
_LAMPS_BELOW_DEG = 16.0
_LAMPS = 1 | 2
"""``carla.VehicleLightState``: position and low beam."""
_WIDTH, _HEIGHT = 480, 270
_SIDE_WIDTH, _SIDE_HEIGHT = 240, 150
_PERSON_WIDTH, _PERSON_HEIGHT = 160, 216
_QUALITY_OF_JPEG = 82


@dataclass(frozen=True, slots=True)
class GalleryPicture:
    """One picture of the page.

    Attributes:
        section: heading below which it stands.
        caption: what it shows.
        pixels: ``(H, W, 3)`` sRGB.
    """

    section: str
    caption: str
    pixels: Pixels


def write_gallery(
    folder: Path, *, seed: int, progress: Callable[[str], None] = lambda _: None
) -> list[str]:
    """Write the page and its pictures into a folder, made if missing.

    Args:
        folder: gets ``index.html`` and a JPEG for each picture.
        seed: places and ways of the actors follow from it.
        progress: called with the name of each picture that was written.

    Returns:
        Names of the pictures' files, in the page's order.
    """
    return write_page(folder, gallery_pictures(seed), progress)


def gallery_pictures(seed: int) -> Iterator[GalleryPicture]:
    """All pictures of the gallery, section by section."""
    for name, sides in every_vehicle(_SIDE_WIDTH, _SIDE_HEIGHT):
        yield GalleryPicture("Vehicles", name, np.concatenate(sides, axis=1))
    for name, sides in every_pedestrian(_PERSON_WIDTH, _PERSON_HEIGHT):
        yield GalleryPicture("People", name, np.concatenate(sides, axis=1))
    for name, pixels in people_pictures(200, 270).items():
        yield GalleryPicture("People, in motion", name, pixels)
    for town in TOWNS:
        yield from _town(town, seed)


def _town(name: str, seed: int) -> Iterator[GalleryPicture]:
    """Streets of a town at noon, dusk and night; the first town's in all weathers, too."""
    presets = named_presets()
    town = town_of(name)
    with WorldSensors(town) as sensors:
        scene = populate(town, sensors, vehicles=40, walkers=40, seed=seed)
        views = busy_places(scene.state(), town.spawn_points, _PLACES)
        for preset in WEATHERS if name == TOWNS[0] else ():
            pixels = _street(scene, town.spawn_points[views[0]], presets[preset])
            yield GalleryPicture("Weathers, dusk and night", f"{name}, {preset}", pixels)
        for place in views:
            for light, weather in _lights().items():
                pixels = _street(scene, town.spawn_points[place], weather)
                yield GalleryPicture("Towns", f"{name}, lane {place}, {light}", pixels)


def _lights() -> dict[str, Weather]:
    presets = named_presets()
    dusk = replace(presets["ClearSunset"], sun_altitude_angle=_DUSK_DEG)
    return {"noon": presets["ClearNoon"], "dusk": dusk, "night": presets["ClearNight"]}


def busy_places(state: WorldState, places: NDArray[np.float64], count: int) -> list[int]:
    """The places that look on most people and vehicles, 40 m from each other, best first.

    Args:
        state: the actors.
        places: ``(P, 6)`` x, y, z, pitch, yaw, roll.
        count: how many of them at most.
    """
    shown = np.isin(state.kind, (ActorKind.WALKER, ActorKind.VEHICLE))
    worth = np.where(state.kind[shown] == ActorKind.WALKER, 2.0, 1.0)
    offset = state.location[shown, :2] - places[:, None, :2]
    yaw = np.radians(places[:, 4])[:, None]
    ahead = offset[..., 0] * np.cos(yaw) + offset[..., 1] * np.sin(yaw)
    aside = np.abs(offset[..., 1] * np.cos(yaw) - offset[..., 0] * np.sin(yaw))
    seen = (ahead > 6.0) & (ahead < 50.0) & (aside < 0.8 * ahead)
    score = (seen * worth / np.maximum(ahead, 6.0)).sum(axis=1)
    # Who stands in the way hides all else.
    score[((np.abs(ahead) < 9.0) & (aside < 3.0)).any(axis=1)] = -1.0
    chosen: list[int] = []
    for place in np.argsort(-score, kind="stable").tolist():
        away = np.linalg.norm(places[chosen, :2] - places[place, :2], axis=1)
        if len(chosen) < count and (away > 40.0).all():
            chosen.append(place)
    return chosen


def _street(scene: ReferenceScene, place: NDArray[np.float64], weather: Weather) -> Pixels:
    """What is seen from a lane; vehicles have their lamps on while the sun is low."""
    x, y, z, _, yaw, _ = place.tolist()
    scene.location, scene.rotation_deg = (x, y, z + 1.6), (-4.0, yaw, 0.0)
    state = scene.state(weather)
    if weather.sun_altitude_angle < _LAMPS_BELOW_DEG:
        vehicles = state.kind == ActorKind.VEHICLE
        state = replace(state, light_state=np.where(vehicles, _LAMPS, state.light_state))
    size = {"image_size_x": _WIDTH, "image_size_y": _HEIGHT}
    return rgb(scene.frame(state, "camera.rgb", **size))


def write_page(
    folder: Path,
    pictures: Iterator[GalleryPicture],
    progress: Callable[[str], None] = lambda _: None,
) -> list[str]:
    """Write pictures and their page into a folder; names of the pictures' files."""
    folder.mkdir(parents=True, exist_ok=True)
    names: list[str] = []
    sections: dict[str, list[str]] = {}
    for picture in pictures:
        name = f"{len(names):03d}.jpg"
        Image.fromarray(picture.pixels).save(folder / name, quality=_QUALITY_OF_JPEG)
        sections.setdefault(picture.section, []).append(figure(name, picture.caption))
        names.append(name)
        progress(f"{name}  {picture.section}: {picture.caption}")
    body = "".join(
        f'<h2>{escape(title)}</h2><div class="grid">{"".join(shown)}</div>'
        for title, shown in sections.items()
    )
    (folder / PAGE).write_text(page("Gallery of the simulator", body), "utf-8")
    return names
