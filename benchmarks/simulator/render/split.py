"""Where the CPU time of a picture goes: rays by kind, shading, edges, the rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.simulator.render.scene import ReferenceScene, named_presets, populate, town_of
from benchmarks.simulator.render.speed import ALL_CAMERAS
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict
from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.cast import empty_geometry
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.film import Film
from carstage_sim.render.picture import Picture, PictureMaker
from carstage_sim.render.pixel_kernels import FAR_M
from carstage_sim.render.quality import SAMPLING, Quality
from carstage_sim.render.scene import Frame
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.sensors.view import NEAR_M, Camera, View

_COLOUR = (800, 600)
_ALL = (1280, 720)
_COLOUR_S, _ALL_MS = 0.18, 350.0
_FOV_DEG = 90.0
_NO_EDGE = 256
"""No two codes differ by so much."""


def check_picture(*, town: str, vehicles: int, weather: str, tries: int, seed: int) -> Verdict:
    """What one colour picture costs, part by part, and one of all outputs, on one thread.

    Args:
        town: the map.
        vehicles: actors on it.
        weather: name of a preset.
        tries: of each measurement; they take turns, and the least time of each counts.
        seed: of the actors' places.
    """
    map_ = town_of(town)
    with WorldSensors(map_, threads=1) as sensors:
        sensors.warm_up()
        scene = populate(map_, sensors, vehicles=vehicles, walkers=0, seed=seed)
        scene.state(named_presets()[weather])
        parts = _parts(scene)
        requests = [_requests(scene, ALL_CAMERAS[:1], _COLOUR), _requests(scene, ALL_CAMERAS, _ALL)]
        work: dict[str, Callable[[], object]] = {
            "colour": _capture(scene, requests[0]),
            "all": _capture(scene, requests[1]),
            **parts.work(),
        }
        for part in work.values():
            part()
        before = slowness()
        spent = {name: float("inf") for name in work}
        for _ in range(tries):
            for name, part in work.items():
                began = time.process_time()
                part()
                spent[name] = min(spent[name], time.process_time() - began)
        slow = 0.5 * (before + slowness())
        parts.close()
    ms = {name: seconds * 1e3 / slow for name, seconds in spent.items()}
    return Verdict(
        "picture",
        (
            Figure("map", town),
            Figure("vehicles", vehicles),
            Figure("weather", weather),
            Figure("machine_slowness", slow),
            Figure("scaled_cpu_s_colour_800x600", ms["colour"] / 1e3, "<=", _COLOUR_S),
            Figure("scaled_cpu_ms_all_outputs_1280x720", ms["all"], "<=", _ALL_MS),
            *_split(ms),
        ),
    )


def _split(ms: dict[str, float]) -> list[Figure]:
    """The parts of the colour picture: what it costs less when each is left out."""
    centres = ms["painted, no edges"]
    shares = {
        "rays_of_the_camera": ms["cast"],
        "rays_to_the_sun": centres - ms["painted, no sun"],
        "rays_from_the_ground_upwards": ms["painted, no sun"] - ms["painted, no sun, no rays"],
        "colours_patterns_film_without_rays": ms["painted, no sun, no rays"],
        "pixels_sampled_again": ms["painted"] - centres,
        "scene_of_the_frame": ms["scene"],
    }
    rest = ms["colour"] - sum(shares.values())
    return [
        *(Figure(f"scaled_cpu_ms_{name}", value) for name, value in shares.items()),
        Figure("scaled_cpu_ms_messages_and_the_rest", rest),
    ]


def _requests(
    scene: ReferenceScene, kinds: tuple[str, ...], size: tuple[int, int]
) -> list[SensorRequest]:
    width, height = size
    return [
        scene.request(kind, number, image_size_x=width, image_size_y=height)
        for number, kind in enumerate(kinds)
    ]


def _capture(scene: ReferenceScene, requests: list[SensorRequest]) -> Callable[[], object]:
    # The world stands still, so that each try has the same picture to make.
    state = scene.state()

    def capture() -> object:
        scene.sensors.reset()
        return scene.sensors.capture(state, requests)

    return capture


@contextmanager
def _no_edges() -> Iterator[None]:
    """Pictures whose makers are made meanwhile sample no pixel again."""
    usual = SAMPLING[Quality.LOW]
    SAMPLING[Quality.LOW] = replace(usual, strong=_NO_EDGE, weak=_NO_EDGE)
    try:
        yield
    finally:
        SAMPLING[Quality.LOW] = usual


@dataclass(slots=True)
class _Parts:
    """One picture, with and without what makes it dear."""

    scene: ReferenceScene
    caster: RayCaster
    whole: PictureMaker
    centres: PictureMaker
    frame: Frame
    camera: Camera

    def close(self) -> None:
        """End the threads."""
        self.caster.close()

    def work(self) -> dict[str, Callable[[], object]]:
        """What is measured, by name."""
        state = self.scene.state()
        light = self.whole.sky.lighting(state.weather, state.timestamp_s)
        dark = light._replace(sun=light.sun * np.float32(0))
        nothing = replace(
            self.frame,
            scene=self.frame.scene._replace(
                static=empty_geometry(), top_planes=self.frame.scene.top_planes[:0]
            ),
        )
        picture = self._picture()
        return {
            "scene": lambda: self.scene.sensors.frame_of(state),
            "cast": lambda: self._view().camera(self.camera),
            "painted": lambda: self.whole.paint(self.frame, picture, light),
            "painted, no edges": lambda: self.centres.paint(self.frame, picture, light),
            "painted, no sun": lambda: self.centres.paint(self.frame, picture, dark),
            "painted, no sun, no rays": lambda: self.centres.paint(nothing, picture, dark),
        }

    def _view(self) -> View:
        weather = self.scene.world.weather
        return View(lambda: self.frame, self.caster, self.whole, weather, 0.0)

    def _picture(self) -> Picture:
        return Picture(
            width=self.camera.width,
            height=self.camera.height,
            fov_deg=_FOV_DEG,
            rotation=rotation_matrix(self.camera.rotation_deg),
            hits=self._view().camera(self.camera),
            skip_row=-1,
            low=NEAR_M,
            high=FAR_M,
            film=Film(),
        )


def _parts(scene: ReferenceScene) -> _Parts:
    caster = RayCaster(1)
    with _no_edges():
        centres = PictureMaker(caster)
    camera = Camera(*_COLOUR, _FOV_DEG, scene.location, scene.rotation_deg, 0)
    frame = scene.sensors.frame_of(scene.state())
    return _Parts(scene, caster, PictureMaker(caster), centres, frame, camera)
