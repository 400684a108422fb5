"""``carstage export``: a dataset in the format that a user's tools read."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin, get_type_hints

import typer

from carstage.cli.output import (
    Debug,
    Json,
    command,
    dataset_address,
    note,
    result,
    result_json,
)
from carstage.exporters.class_map import ClassMap, read_class_map
from carstage.exporters.options import ExportOptions, flag_of

if TYPE_CHECKING:
    from carstage.exporters import ExportSummary


FORMATS = (
    "123d",
    "coco",
    "kitti-object",
    "kitti-stereo",
    "kitti-tracking",
    "mcap",
    "nuscenes",
    "opv2v",
    "semantickitti",
    "video",
    "webdataset",
    "yolo",
)
_MOST_NOTED = 20


def _with_options(function: Callable[..., int | None]) -> Callable[..., int | None]:
    """Replace the parameter ``options`` by one flag for each field of ``ExportOptions``."""
    types = get_type_hints(ExportOptions)

    @functools.wraps(function)
    def wrapped(**given: Any) -> int | None:
        choices = {option.name: given.pop(option.name) for option in fields(ExportOptions)}
        lists = {name: tuple(choices[name] or ()) for name in ("cameras", "classes", "episodes")}
        file = choices["class_map"]
        mapped = {"class_map": None if file is None else read_class_map(file)}
        return function(options=ExportOptions(**{**choices, **lists, **mapped}), **given)

    parameters = []
    for parameter in inspect.signature(function, eval_str=True).parameters.values():
        if parameter.name != "options":
            parameters.append(parameter)
            continue
        for option in fields(ExportOptions):
            shown = typer.Option(
                flag_of(option), metavar=option.metadata["metavar"], help=option.metadata["help"]
            )
            kind = _plain(types[option.name])
            default = None if option.default == () else option.default
            parameters.append(
                parameter.replace(
                    name=option.name, annotation=Annotated[kind, shown], default=default
                )
            )
    wrapped.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    wrapped.__annotations__ = {entry.name: entry.annotation for entry in parameters}
    del wrapped.__wrapped__
    return wrapped


def _plain(kind: Any) -> Any:
    """The type as the command line parses it; which words may be is for ``ExportOptions``."""
    if get_origin(kind) is tuple:
        return list[str] | None
    if ClassMap in get_args(kind):
        return Path | None
    if any(get_origin(part) is Literal for part in get_args(kind)):
        return str | None
    return kind


@command
@_with_options
def export(
    format_name: Annotated[
        str, typer.Argument(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")
    ],
    dataset: Annotated[
        Path,
        typer.Argument(
            metavar="DATASET", help="Folder or address of the dataset.", callback=dataset_address
        ),
    ],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="Folder to make, or an address.", callback=dataset_address
        ),
    ],
    options: ExportOptions,
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
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a dataset in another format; OUT appears when all of it is written."""
    del debug
    import carstage
    from carstage.cli.progress import watch_phases

    with watch_phases() as progress:
        summary = carstage.export(
            format_name,
            dataset,
            out,
            options,
            overwrite=overwrite,
            allow_incomplete=allow_incomplete,
            workers=workers,
            progress=progress,
        )
    _note_what_is_missing(summary)
    if json:
        result_json(summary.to_json())
    else:
        result(
            f"{summary.path}: {format_name}, {summary.frames} frames of {summary.episodes} "
            f"episode{'s' * (summary.episodes != 1)}"
        )


def _note_what_is_missing(summary: ExportSummary) -> None:
    for warning in summary.warnings:
        note(f"warning: {warning}")
    for problem in summary.problems[:_MOST_NOTED]:
        place = f"episode {problem.episode}" if problem.episode else "dataset"
        note(f"{problem.severity}: {place}: {problem.message}")
    if len(summary.problems) > _MOST_NOTED:
        note(f"and {len(summary.problems) - _MOST_NOTED} more; see carstage validate")
    for episode in summary.episodes_left_out:
        note(f"Left out: episode {episode}.")
    if summary.frames_left_out:
        note(f"Left out: {summary.frames_left_out} frames.")
    for name, rows in summary.classes_left_out.items():
        note(f"Left out: {rows} labels of class {name!r}, which has no target.")
    for name, rows in summary.unknown_classes.items():
        note(f"Left out: {rows} labels of class {name!r}, which no format knows.")
    for sensor, frames in summary.sensors_left_out.items():
        note(
            f"Left out: sensor {sensor}, {frames} frames, for which {summary.format} has no place."
        )
