"""``carstage dataset``: a dataset, or an export, as a whole."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from carstage.cli.output import (
    Debug,
    Json,
    command,
    confirmed,
    dataset_address,
    folder,
    note,
    result,
    result_json,
)

dataset_app = typer.Typer(
    help="Rename and delete datasets and exports; write their maps.", no_args_is_help=True
)


@dataset_app.command("rename")
@command
def rename(
    dataset: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|URL",
            help="Folder of the dataset, or its address.",
            callback=dataset_address,
        ),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="How it shall be called.")],
    debug: Debug = False,
) -> None:
    """Give a dataset another name; its folder stays where it is."""
    del debug
    from carstage.storage.keeping import rename_dataset

    rename_dataset(dataset, name)


@dataset_app.command("delete")
@command
def delete(
    place: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|URL",
            help="Folder or address of the dataset or export.",
            callback=dataset_address,
        ),
    ],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    debug: Debug = False,
) -> None:
    """Remove a dataset with its episodes and runs, or an export; other files there stay."""
    del debug
    from carstage.errors import BadInputError
    from carstage.exporters.keeping import is_export, remove_export
    from carstage.runs.keeping import runs_that_go_on
    from carstage.runs.preflight import work_folder
    from carstage.storage.keeping import check_removable, remove_dataset

    exported = is_export(place)
    if not exported:
        check_removable(place)
        going = runs_that_go_on(work_folder(place, None))
        if going:
            raise BadInputError(f"Run {going[0]} records into {place}.", "Stop it first.")
    if not (yes or confirmed(f"{place}", "Remove all of it? This cannot be undone.")):
        raise BadInputError(f"{place} was not removed.", "Say yes, or add --yes.")
    if exported:
        remove_export(place)
        note(f"Removed {place}.")
        return
    left = remove_dataset(place)
    kept = f"; what was not ours stays: {', '.join(left)}" if left else ""
    note(f"Removed {place}{kept}.")


@dataset_app.command("maps")
@command
def maps(
    dataset: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|URL",
            help="Folder of the dataset, or its address.",
            callback=dataset_address,
        ),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder to make.", callback=folder)],
    format_name: Annotated[
        str, typer.Option("--format", metavar="geojson|lanelet2", help="What to write.")
    ] = "geojson",
    map_names: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="NAME", help="A town; default: all. Repeatable."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an export that stands at OUT.")
    ] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the towns' vector maps in degrees of longitude and latitude, a file each."""
    del debug
    from carstage.exporters import export_maps

    files = export_maps(format_name, dataset, out, maps=map_names or (), overwrite=overwrite)
    if json:
        result_json({"format": format_name, "files": [str(path) for path in files]})
    else:
        for path in files:
            result(str(path))
