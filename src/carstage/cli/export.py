"""``carstage export``: a dataset in the format that a user's tools read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carstage.cli.output import command, enable_debug, note, result, result_json

if TYPE_CHECKING:
    from carstage.exporters import Completeness, ExportSummary


FORMATS = (
    "coco",
    "kitti-object",
    "kitti-tracking",
    "mcap",
    "nuscenes",
    "video",
    "webdataset",
    "yolo",
)
_MOST_NOTED = 20


@command
def export(
    format_name: Annotated[
        str, typer.Argument(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")
    ],
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="Folder of the dataset.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder to make.")],
    camera: Annotated[
        list[str] | None,
        typer.Option("--camera", metavar="ID", help="A camera to export. Repeatable."),
    ] = None,
    lidar: Annotated[
        str | None, typer.Option("--lidar", metavar="ID", help="The LiDAR to export.")
    ] = None,
    boxes: Annotated[
        str | None,
        typer.Option(
            "--boxes",
            metavar="amodal|modal",
            help="2D boxes around the silhouette or around the visible pixels.",
        ),
    ] = None,
    occlusion: Annotated[
        str | None,
        typer.Option(
            "--occlusion",
            metavar="stage_vo|pixel",
            help="KITTI's occlusion levels by STAGE-VO or by counted pixels.",
        ),
    ] = None,
    min_lidar_points: Annotated[
        int | None,
        typer.Option("--min-lidar-points", help="Leave out objects with fewer LiDAR points."),
    ] = None,
    max_distance_m: Annotated[
        float | None, typer.Option("--max-distance-m", help="Leave out objects farther away.")
    ] = None,
    include_invisible: Annotated[
        bool, typer.Option("--include-invisible", help="Export objects that nothing is seen of.")
    ] = False,
    validation_share: Annotated[
        float, typer.Option("--validation-share", help="Share of the episodes for validation.")
    ] = 0.0,
    codec: Annotated[
        str | None,
        typer.Option(
            "--codec", metavar="ffv1|h264", help="Of videos: without loss (default), or small."
        ),
    ] = None,
    class_name: Annotated[
        list[str] | None,
        typer.Option(
            "--class",
            metavar="NAME",
            help="A class to export, also rider, pole and the like. Repeatable.",
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an export that stands at OUT.")
    ] = False,
    allow_incomplete: Annotated[
        bool,
        typer.Option("--allow-incomplete", help="Leave out what is missing or damaged."),
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=0, help="Processes; 0: this one only. Default: CPU cores."),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object as the last line.")
    ] = False,
    debug: Annotated[
        bool,
        typer.Option("--debug", help="Show tracebacks.", callback=lambda on: on and enable_debug()),
    ] = False,
) -> None:
    """Write a dataset in another format; OUT appears when all of it is written."""
    del debug
    from carstage.cli.progress import watch_frames
    from carstage.dataset import Dataset
    from carstage.exporters import (
        ExportOptions,
        check_target,
        examine,
        export_dataset,
        exporter_for,
    )

    choices: dict[str, Any] = {"boxes": boxes, "occlusion": occlusion, "codec": codec}
    options = ExportOptions(
        cameras=tuple(camera or ()),
        lidar=lidar,
        min_lidar_points=min_lidar_points,
        max_distance_m=max_distance_m,
        include_invisible=include_invisible,
        validation_share=validation_share,
        classes=tuple(class_name or ()),
        **choices,
    )
    # What can be refused at once is refused before every file is read.
    exporter_for(format_name, options)
    source = Dataset(dataset)
    check_target(out, source.path, overwrite=overwrite)
    with watch_frames("Checking") as progress:
        found = examine(source, progress)
    with watch_frames("Exporting") as progress:
        summary = export_dataset(
            dataset,
            out,
            format_name,
            options,
            overwrite=overwrite,
            allow_incomplete=allow_incomplete,
            workers=workers,
            completeness=found,
            progress=progress,
        )
    _note_what_is_missing(found, summary)
    if json:
        result_json(summary.to_json())
    else:
        result(
            f"{summary.path}: {format_name}, {summary.frames} frames of {summary.episodes} "
            f"episode{'s' * (summary.episodes != 1)}"
        )


def _note_what_is_missing(found: Completeness, summary: ExportSummary) -> None:
    for problem in found.problems[:_MOST_NOTED]:
        place = f"episode {problem.episode}" if problem.episode else "dataset"
        note(f"{problem.severity}: {place}: {problem.message}")
    if len(found.problems) > _MOST_NOTED:
        note(f"and {len(found.problems) - _MOST_NOTED} more; see carstage validate")
    for episode in summary.episodes_left_out:
        note(f"Left out: episode {episode}.")
    if summary.frames_left_out:
        note(f"Left out: {summary.frames_left_out} frames.")
    for name, rows in summary.unknown_classes.items():
        note(f"Left out: {rows} labels of class {name!r}, which no format knows.")
