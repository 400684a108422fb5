"""The commands that measure the framework: capture, conversion, labels, scale, the interface."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.registry import Scratch, benchmark, command_line, report
from carstage.cli.output import Json, note, result


class RawStore(str, Enum):
    """How the raw pictures of cameras are kept."""

    CHUNKLOG = "chunklog"
    MMAP = "mmap"


Store = Annotated[RawStore, typer.Option("--raw-store", help="How raw pictures are kept.")]


@benchmark("overhead", takes="4 minutes")
def overhead(
    ticks: Annotated[int, typer.Option(min=20, help="Of each block.")] = 200,
    rounds: Annotated[int, typer.Option(min=1, help="Blocks of each client.")] = 3,
    raw_store: Store = RawStore.CHUNKLOG,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """What capture adds to a tick, against a client that drops everything."""
    from benchmarks.framework.overhead import measure_overhead
    from carstage.cli.progress import watch_steps

    with watch_steps("Blocks", "blocks") as progress:
        verdict = measure_overhead(
            ticks=ticks,
            rounds=rounds,
            raw_store=raw_store.value,
            scratch=scratch,
            progress=progress,
        )
    return report(verdict, json)


@benchmark("converters", takes="20 seconds")
def converters(
    rounds: Annotated[int, typer.Option(min=1, help="Of which the least counts.")] = 3,
    json: Json = False,
) -> int:
    """What starting the converting processes of a run costs."""
    from benchmarks.framework.converters import measure_converters

    return report(measure_converters(rounds=rounds), json)


@benchmark("sharing", takes="2 minutes")
def sharing(
    dataset: Annotated[
        Path | None,
        typer.Option("--dataset", metavar="DIR", help="Default: a demonstration is recorded."),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Of which the median counts.")] = 3,
    json: Json = False,
) -> int:
    """What validation and exports take in one process and in many."""
    from benchmarks.framework.sharing import measure_sharing
    from carstage.cli.progress import watch_steps

    with watch_steps("Rounds", "rounds") as progress:
        verdict = measure_sharing(dataset, rounds=rounds, progress=progress)
    return report(verdict, json)


@benchmark("cores", takes="3 minutes")
def cores(
    counts: Annotated[
        list[int] | None,
        typer.Option("--cores", min=1, help="Hold the simulator to so many. Repeatable."),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Recordings with each number.")] = 3,
    json: Json = False,
) -> int:
    """How much faster more cores make a tick of the demonstration."""
    from benchmarks.framework.cores import measure_cores
    from carstage.cli.progress import watch_steps

    with watch_steps("Recordings", "recordings") as progress:
        verdict = measure_cores(counts, rounds=rounds, progress=progress)
    return report(verdict, json)


@benchmark("conversion", takes="1 minute")
def conversion(
    frames: Annotated[int, typer.Option(min=4, help="Pictures per round.")] = 24,
    rounds: Annotated[int, typer.Option(min=1, help="How often both are measured.")] = 5,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """What a picture costs from raw log to hashed file, against its encoder alone."""
    from benchmarks.framework.conversion import measure_conversion
    from carstage.cli.progress import watch_steps

    with watch_steps("Rounds", "rounds") as progress:
        verdict = measure_conversion(
            frames=frames, rounds=rounds, scratch=scratch, progress=progress
        )
    return report(verdict, json)


@benchmark("hashing", takes="1 minute")
def hashing(
    rounds: Annotated[int, typer.Option(min=3, help="How often each is measured.")] = 7,
    json: Json = False,
) -> int:
    """What hashing costs by BLAKE3, against the SHA-256 that it replaced."""
    from benchmarks.framework.hashing import measure_hashing

    return report(measure_hashing(rounds), json)


@benchmark("planning", takes="1 minute")
def planning(
    episodes: Annotated[int, typer.Option(min=2, max=100_000, help="To plan.")] = 100_000,
    json: Json = False,
) -> int:
    """What planning 100,000 episodes costs in CPU time and memory."""
    from benchmarks.framework.planning import measure_planning

    return report(measure_planning(episodes), json)


@benchmark("memory", takes="20 minutes")
def memory(
    frames: Annotated[int, typer.Option(min=100, help="To record.")] = 10_000,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Whether memory stays within the budget while the disk is slow."""
    from benchmarks.framework.memory import measure_memory
    from carstage.cli.progress import watch_steps

    with watch_steps("Ticks", "ticks") as progress:
        verdict = measure_memory(frames=frames, scratch=scratch, progress=progress)
    return report(verdict, json)


@benchmark("frames-check", takes="15 minutes")
def frames_check(
    ticks: Annotated[int, typer.Option(min=10, help="To record and compare.")] = 20_000,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Whether the log holds, under each frame, what the server sent for it."""
    from benchmarks.framework.frames_check import check_frames
    from carstage.cli.progress import watch_steps

    with watch_steps("Ticks", "ticks") as progress:
        verdict = check_frames(ticks=ticks, scratch=scratch, progress=progress)
    return report(verdict, json)


@benchmark("labels", takes="30 minutes")
def labels(
    towns: Annotated[list[str] | None, typer.Option(help="Where. Repeatable.")] = None,
    scenes: Annotated[int, typer.Option(min=1, help="In each town.")] = 14,
    maps: Annotated[
        Path | None, typer.Option(help="Folder of OpenDRIVE files, for other towns.")
    ] = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Whether labels of pixels, occlusion and 2D boxes are true, object by object."""
    from benchmarks.framework.labels import TOWNS, measure_labels
    from carstage.cli.progress import watch_steps

    with watch_steps("Scenes", "scenes") as progress:
        verdict, objects = measure_labels(
            towns=towns or TOWNS, scenes=scenes, maps=maps, scratch=scratch, progress=progress
        )
    return report(verdict, json, objects=objects)


@benchmark("annotation", takes="1 minute")
def annotation(
    frames: Annotated[int, typer.Option(min=1, help="How often each method labels.")] = 30,
    json: Json = False,
) -> int:
    """What labelling a frame with a hundred objects costs."""
    from benchmarks.framework.annotation import measure_annotation
    from carstage.cli.progress import watch_steps

    with watch_steps("Frames", "frames") as progress:
        verdict = measure_annotation(frames=frames, progress=progress)
    return report(verdict, json)


@benchmark("gui", takes="8 minutes")
def gui(
    minutes: Annotated[
        float, typer.Option(min=0.2, help="How long a run's live pictures are watched.")
    ] = 5.0,
    out: Annotated[
        Path | None, typer.Option("--out", help="File for the JSON object, too.")
    ] = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """How fast the interface is there, follows a drag, and shows a run; needs Chromium."""
    from json import dumps

    from benchmarks.framework.gui import measure_gui
    from carstage.cli.progress import watch_steps

    with watch_steps("Watched", "s") as progress:
        verdict = measure_gui(minutes=minutes, scratch=scratch, progress=progress)
    if out is not None:
        record = {**verdict.record(), "command": command_line()}
        out.write_text(dumps(record, indent=1) + "\n", "utf-8")
    return report(verdict, json)


@benchmark("demo", takes="5 minutes")
def demo(json: Json = False) -> int:
    """How long the demo takes a new user, with empty and with warm caches, and its memory."""
    from benchmarks.framework.demo import measure_demo

    return report(measure_demo(), json)


@benchmark("demo-against", takes="8 minutes")
def demo_against(
    python: Annotated[
        str, typer.Argument(help="Python in whose environment the other Car-STAGE is installed.")
    ],
    rounds: Annotated[int, typer.Option(min=1, help="Demos of each that count.")] = 5,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Whether the demo gives the same data as another installation's, and what both cost."""
    from benchmarks.framework.demo_against import measure_demo_against
    from carstage.cli.progress import watch_steps

    with watch_steps("Demos", "demos") as progress:
        verdict = measure_demo_against(python, rounds, scratch, progress)
    return report(verdict, json)


@benchmark("same-bytes", takes="5 minutes")
def same_bytes(
    pythons: Annotated[
        list[str], typer.Argument(help="Pythons in whose environments Car-STAGE is installed.")
    ],
    town: Annotated[
        list[str] | None,
        typer.Option("--town", help="A built-in town or an OpenDRIVE file; default: all built-in."),
    ] = None,
    json: Json = False,
) -> int:
    """Whether towns and frames have the same bytes under other Pythons and dependencies."""
    from benchmarks.framework.same_bytes import TOWNS, measure_same_bytes
    from carstage.cli.progress import watch_steps

    with watch_steps("Same bytes", "steps") as progress:
        verdict = measure_same_bytes(pythons, town or TOWNS, progress)
    return report(verdict, json)


@benchmark("recording-beside", takes="10 minutes")
def recording_beside(
    ticks: Annotated[int, typer.Option(min=100, help="Of each run of the program.")] = 5000,
    rounds: Annotated[int, typer.Option(min=1, help="Runs of each kind.")] = 3,
    json: Json = False,
) -> int:
    """Whether `record` loses no frame of a program at full speed, and how much it slows it."""
    from benchmarks.framework.recording_beside import measure_recording_beside
    from carstage.cli.progress import watch_steps

    with watch_steps("Programs", "programs") as progress:
        verdict = measure_recording_beside(ticks, rounds, progress)
    return report(verdict, json)


@benchmark("scale", takes="10 minutes")
def scale(
    workers: Annotated[
        list[int] | None, typer.Option("--workers", min=1, help="Beside one. Repeatable.")
    ] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Of each worker in each round.")] = 2,
    duration_s: Annotated[float, typer.Option(min=1.0, help="Of an episode, simulated.")] = 20.0,
    threads: Annotated[int, typer.Option(min=1, help="Of each worker's simulator.")] = 1,
    rounds: Annotated[int, typer.Option(min=1, help="How often each has its turn.")] = 3,
    ray: Annotated[
        bool, typer.Option("--ray", help="Compare local processes with Ray instead (as root).")
    ] = False,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """How much more several workers record than one, and what Ray costs over local processes."""
    from benchmarks.framework.scale import measure_scale
    from carstage.cli.progress import watch_steps

    with watch_steps("Campaigns", "campaigns") as progress:
        verdict = measure_scale(
            workers or [2],
            episodes=episodes,
            duration_s=duration_s,
            threads=threads,
            rounds=rounds,
            ray=ray,
            scratch=scratch,
            progress=progress,
        )
    return report(verdict, json)


@benchmark("globe", takes="3 minutes")
def globe(
    town: Annotated[
        list[str] | None, typer.Option("--town", help="A built-in town; default: all.")
    ] = None,
    version: Annotated[
        list[str] | None, typer.Option("--version", help="Of CARLA; default: all known.")
    ] = None,
    json: Json = False,
) -> int:
    """Whether positions in degrees, from all that has them, lead back to the same metres."""
    from benchmarks.framework.globe import TOWNS, VERSIONS, measure_globe
    from carstage.cli.progress import watch_steps

    with watch_steps("Globe", "recordings") as progress:
        verdict = measure_globe(town or TOWNS, version or VERSIONS, progress)
    return report(verdict, json)


@benchmark("lane-lines", takes="8 minutes")
def lane_lines(
    town: Annotated[
        list[str] | None,
        typer.Option("--town", help="A built-in town, or one of CARLA's; default: five."),
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.5, help="Simulated, of each drive.")] = 8.0,
    drives: Annotated[int, typer.Option(min=1, help="In each town.")] = 4,
    json: Json = False,
) -> int:
    """Whether the vector map has what is painted on the road, pixel by pixel."""
    from benchmarks.framework.lane_lines import TOWNS, measure_lane_lines
    from carstage.cli.progress import watch_steps

    with watch_steps("Lane lines", "towns") as progress:
        verdict = measure_lane_lines(town or TOWNS, seconds, drives, progress)
    return report(verdict, json)


@benchmark("warping", takes="4 minutes")
def warping(
    town: Annotated[
        list[str] | None, typer.Option("--town", help="A built-in town; default: all.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.2, help="Simulated, in each town.")] = 3.0,
    json: Json = False,
) -> int:
    """Whether pictures warped by their flow look like the next ones, on pedestrians too."""
    from benchmarks.framework.warping import TOWNS, measure_warping
    from carstage.cli.progress import watch_steps

    with watch_steps("Warping", "recordings") as progress:
        verdict = measure_warping(town or TOWNS, seconds, progress)
    return report(verdict, json)


@benchmark("object-store", takes="6 minutes")
def object_store(
    rounds: Annotated[
        int, typer.Option(min=0, help="Episodes into each; 0: count requests alone.")
    ] = 3,
    seconds: Annotated[float, typer.Option(min=0.5, help="Simulated ones of an episode.")] = 5.0,
    json: Json = False,
) -> int:
    """What recording into an object store costs, against a folder."""
    from benchmarks.framework.object_store import measure_object_store
    from carstage.cli.progress import watch_steps

    with watch_steps("Episodes", "episodes") as progress:
        verdict = measure_object_store(rounds, seconds, progress)
    return report(verdict, json)


@benchmark("catalog", takes="6 minutes")
def catalog(
    episodes: Annotated[int, typer.Option(min=1000, help="Of the catalog.")] = 1_000_000,
    labelled: Annotated[int, typer.Option(min=1, help="Of them, with label tables.")] = 1000,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """How fast a catalog of a million episodes lists a page and answers a label query."""
    from benchmarks.framework.catalog import measure_catalog
    from carstage.cli.progress import watch_steps

    with watch_steps("Databases", "databases") as progress:
        verdict = measure_catalog(episodes, labelled, scratch, progress)
    return report(verdict, json)


@benchmark("on-paper", takes="1 second")
def on_paper(
    workers: Annotated[int, typer.Option(min=1, help="Of one core each.")] = 1000,
    frames: Annotated[int, typer.Option(min=1, help="All together.")] = 10_000_000,
    episode_s: Annotated[float, typer.Option(min=0.1, help="Simulated.")] = 60.0,
) -> int:
    """What many workers and frames cost, computed from the committed figures."""
    from benchmarks.framework.on_paper import load_measured, table
    from benchmarks.framework.on_paper import on_paper as computed

    rows = computed(load_measured(), workers=workers, frames=frames, episode_s=episode_s)
    result(table(rows))
    return 0


@benchmark("events", takes="15 minutes")
def events(
    kind: Annotated[
        list[str] | None, typer.Option("--kind", help="Of events; may be given again; all.")
    ] = None,
    town: Annotated[
        list[str] | None, typer.Option("--town", help="May be given again; two for each kind.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Episodes of each kind in each town.")] = 20,
    seconds: Annotated[float, typer.Option(min=5.0, help="Simulated, of each episode.")] = 120.0,
    comfort: Annotated[bool, typer.Option("--comfort", help="The ego drives gently.")] = False,
    json: Json = False,
) -> int:
    """Whether built-in events happen as they were asked for, by the world's record."""
    from benchmarks.framework.events import TOWNS, measure_events
    from carstage.cli.progress import watch_steps

    for name in kind or ():
        if name not in TOWNS:
            note(f"Unknown kind {name}. Known: {', '.join(TOWNS)}.")
            return 2
    with watch_steps("Episodes", "episodes") as progress:
        campaign = measure_events(
            tuple(kind or TOWNS),
            towns=tuple(town or ()),
            seeds=seeds,
            seconds=seconds,
            comfort=comfort,
            progress=progress,
        )
    return report(campaign, json)


@benchmark("crossings", takes="4 minutes")
def crossings(
    town: Annotated[
        list[str] | None, typer.Option("--town", help="May be given again; the stage towns.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Episodes in each town.")] = 3,
    seconds: Annotated[float, typer.Option(min=2.0, help="Simulated, of each episode.")] = 10.0,
    crossing_percent: Annotated[
        float, typer.Option(min=0.0, max=100.0, help="Of the pedestrians.")
    ] = 100.0,
    json: Json = False,
) -> int:
    """Whether pedestrians cross near the ego, keep to the lights, and look before they step out."""
    from benchmarks.framework.crossings import TOWNS, measure_crossings
    from carstage.cli.progress import watch_steps

    with watch_steps("Episodes", "episodes") as progress:
        campaign = measure_crossings(
            tuple(town or TOWNS),
            seeds=seeds,
            seconds=seconds,
            crossing_percent=crossing_percent,
            progress=progress,
        )
    return report(campaign, json)


@benchmark("scenic-examples", takes="40 minutes")
def scenic_examples(
    folder: Annotated[Path, typer.Argument(help="Scenic's folder, with examples and assets.")],
    python: Annotated[Path, typer.Option(help="The Python that has Scenic and carla.")],
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="Programs whose path contains this; may be given again; all."),
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.5, help="Simulated, of each program.")] = 3.0,
    done: Annotated[
        Path | None,
        typer.Option(help="File of what was recorded: made, or gone on with; several share it."),
    ] = None,
    json: Json = False,
) -> int:
    """Whether Scenic's own examples for CARLA run as scenarios; nothing is fetched."""
    from benchmarks.framework.scenic_examples import (
        measure_scenic_examples,
        programs,
        rows,
        text,
    )
    from carstage.cli.progress import watch_steps

    chosen = [
        path
        for path in programs(folder)
        if not only or any(part in path.as_posix() for part in only)
    ]
    if not chosen:
        note(f"There is no program for CARLA in {folder / 'examples' / 'carla'}.")
        return 2
    with watch_steps("Programs", "programs") as progress:
        verdict, tried = measure_scenic_examples(
            folder, python, chosen=chosen, seconds=seconds, done=done, progress=progress
        )
    return report(verdict, json, text(tried), programs=rows(tried))
