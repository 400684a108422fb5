"""The check ``render``: budget and looks of the reference scene."""

from __future__ import annotations

from benchmarks.simulator.render.compiling import compile_figures
from benchmarks.simulator.render.looks import look_figures
from benchmarks.simulator.render.scene import ReferenceScene, populate, town_of
from benchmarks.simulator.render.speed import picture_ms, speed_figures
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict
from carstage_sim.render.quality import Quality
from carstage_sim.sensors import WorldSensors

_VEHICLES, _WALKERS = 70, 30
_MOST_FOR_EPIC = 2.5


def check_render(*, town: str, tries: int, seed: int, compiling: bool) -> Verdict:
    """Measures the reference scene.

    Args:
        town: map of the scene.
        tries: of each measurement; the least time counts.
        seed: of the places of actors.
        compiling: measure also how long kernels take to compile, which takes minutes.
    """
    figures = [Figure("map", town), Figure("vehicles", _VEHICLES), Figure("walkers", _WALKERS)]
    if compiling:
        figures += compile_figures()
    map_ = town_of(town)
    figures.append(Figure("triangles_of_the_town", len(map_.static_mesh.triangles)))
    with (
        WorldSensors(map_, threads=1) as sensors,
        WorldSensors(map_, threads=1, quality=Quality.EPIC) as epic,
    ):
        sensors.warm_up()
        scene = populate(map_, sensors, vehicles=_VEHICLES, walkers=_WALKERS, seed=seed)
        figures += speed_figures(scene, tries=tries)
        better = ReferenceScene(scene.world, scene.location, scene.rotation_deg, epic)
        ratio = min(picture_ms(better) / picture_ms(scene) for _ in range(tries))
        figures.append(Figure("epic_over_low", ratio, "<=", _MOST_FOR_EPIC))
        figures += look_figures(scene)
    figures.append(Figure("machine_slowness_afterwards", slowness()))
    return Verdict("render", tuple(figures))
