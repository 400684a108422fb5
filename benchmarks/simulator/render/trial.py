"""The check ``render``: budget and looks of the reference scene."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.simulator.calibration import slowness
from benchmarks.simulator.render.compiling import compile_figures
from benchmarks.simulator.render.gallery import paint_gallery
from benchmarks.simulator.render.looks import look_figures
from benchmarks.simulator.render.speed import picture_ms, speed_figures
from benchmarks.simulator.render.stage import Stage, populate, town_of
from benchmarks.simulator.verdict import Figure, Verdict
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
        WorldSensors(map_, threads=1) as suite,
        WorldSensors(map_, threads=1, quality=Quality.EPIC) as epic,
    ):
        suite.warm_up()
        stage = populate(map_, suite, vehicles=_VEHICLES, walkers=_WALKERS, seed=seed)
        figures += speed_figures(stage, tries=tries)
        better = Stage(stage.world, stage.location, stage.rotation_deg, epic)
        ratio = min(picture_ms(better) / picture_ms(stage) for _ in range(tries))
        figures.append(Figure("epic_over_low", ratio, "<=", _MOST_FOR_EPIC))
        figures += look_figures(stage)
    figures.append(Figure("machine_slowness_afterwards", slowness()))
    return Verdict("render", tuple(figures))


def _run(arguments: argparse.Namespace) -> Verdict:
    if arguments.pictures is not None:
        names = paint_gallery(arguments.pictures, town=arguments.map, seed=arguments.seed)
        return Verdict("render", (Figure("pictures", len(names)),), names)
    return check_render(
        town=arguments.map,
        tries=arguments.tries,
        seed=arguments.seed,
        compiling=not arguments.without_compiling,
    )


def add_render(checks: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the check to a command line."""
    parser = checks.add_parser("render", help="pictures and point clouds come in time, look right")
    parser.add_argument("--map", default="Stage02", help="map of the reference scene")
    parser.add_argument("--tries", type=int, default=5, help="of each measurement")
    parser.add_argument("--seed", type=int, default=3, help="of the places of actors")
    parser.add_argument("--without-compiling", action="store_true", help="do not time the compiler")
    parser.add_argument(
        "--pictures", type=Path, metavar="DIR", help="paint the documentation's pictures instead"
    )
    parser.add_argument("--json", action="store_true", help="last line is a JSON object")
    parser.set_defaults(run=_run)
