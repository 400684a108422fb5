"""The commands that measure what is told of the surroundings: grids, voxels, clouds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.registry import benchmark, report
from carstage.cli.output import Json


@benchmark("birds-eye", takes="3 minutes")
def birds_eye(
    town: Annotated[
        list[str] | None, typer.Option("--town", help="A built-in town; default: all.")
    ] = None,
    places: Annotated[int, typer.Option(min=0, help="In each town.")] = 6,
    dataset: Annotated[
        list[Path] | None,
        typer.Option("--dataset", help="One with grids, for objects and cost."),
    ] = None,
    json: Json = False,
) -> int:
    """Whether bird's-eye grids are those of other sources and another library; their cost."""
    from benchmarks.framework.birds_eye import TOWNS, measure_birds_eye
    from carstage.cli.progress import watch_steps

    with watch_steps("Bird's eye", "grids") as progress:
        verdict = measure_birds_eye(town or TOWNS, places, dataset or (), progress)
    return report(verdict, json)


@benchmark("occupancy", takes="3 minutes")
def occupancy(
    dataset: Annotated[
        list[Path],
        typer.Option("--dataset", help="One with voxels, depth, instances, semantic LiDARs."),
    ],
    near_m: Annotated[float, typer.Option(min=2, help="How far meshes are compared.")] = 8.0,
    json: Json = False,
) -> int:
    """What of depth images voxels explain, whether they are those of meshes, and their cost."""
    from benchmarks.framework.occupancy import measure_occupancy
    from carstage.cli.progress import watch_steps

    with watch_steps("Occupancy", "frames") as progress:
        verdict = measure_occupancy(dataset, near_m, progress)
    return report(verdict, json)


@benchmark("exact-occupancy", takes="3 minutes")
def exact_occupancy(
    dataset: Annotated[
        list[Path],
        typer.Option("--dataset", help="One with exact voxels, depth, instances, semantic LiDARs."),
    ],
    near_m: Annotated[float, typer.Option(min=2, help="How far meshes are compared.")] = 8.0,
    json: Json = False,
) -> int:
    """Whether exact voxels are those of meshes, what others of the same frames lack; their cost."""
    from benchmarks.framework.exact_occupancy import measure_exact_occupancy
    from carstage.cli.progress import watch_steps

    with watch_steps("Exact occupancy", "frames") as progress:
        verdict = measure_exact_occupancy(dataset, near_m, progress)
    return report(verdict, json)


@benchmark("flash-lidar", takes="4 minutes")
def flash_lidar(
    town: Annotated[
        list[str] | None, typer.Option("--town", help="A built-in town; default: all.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.2, help="Simulated, in each town.")] = 4.0,
    json: Json = False,
) -> int:
    """Whether flash LiDARs measure what rays along their beams meet, with the noise asked for."""
    from benchmarks.framework.flash_lidar import TOWNS, measure_flash_lidar
    from carstage.cli.progress import watch_steps

    with watch_steps("Flash LiDAR", "recordings") as progress:
        verdict = measure_flash_lidar(town or TOWNS, seconds, progress)
    return report(verdict, json)


@benchmark("fleet-fusion", takes="1 minute")
def fleet_fusion(
    dataset: Annotated[
        list[Path], typer.Option("--dataset", help="One with agents that have LiDARs.")
    ],
    json: Json = False,
) -> int:
    """Whether the point clouds of a fleet agree on what stands still, within their noise."""
    from benchmarks.framework.fleet_fusion import measure_fusion
    from carstage.cli.progress import watch_steps

    with watch_steps("Frames", "frames") as progress:
        verdict = measure_fusion(dataset, progress)
    return report(verdict, json)
